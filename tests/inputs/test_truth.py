"""Inputs that caused errors in similar tools or earlier versions: ground truth.

Each case states the result of earlier versions and the result now, which `play` checks.
"""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import se3
from slam.data.dataset import open_dataset
from tests.inputs.bench import (
    COARSE,
    FINE,
    LINE,
    ONE_HZ,
    POSES,
    SCANS,
    STAMPS,
    START,
    Bench,
    Case,
    changed,
    euroc,
    kitti,
    mirrored,
    nanoseconds,
    no_truth,
    numbered,
    opened,
    refused,
    rows,
    text,
    truth,
    without,
)


def fewer_rows(bench: Bench) -> None:
    for number in (20, 21, 22):
        (bench.folder / f"{number:06d}.bin").unlink()
    (bench.folder / "times.txt").write_text("".join(f"{stamp}\n" for stamp in np.delete(STAMPS, [20, 21, 22])))
    bench.poses(*text(kitti()[:280]))
    no_truth("gap in numbering", "no ground truth")(open_dataset(bench.folder))


CASES = [
    Case("41", "TUM with commas", "refused", "read", opened(text(rows(), ","), truth())),
    Case(
        "41b",
        "TUM with a header without #",
        "refused",
        "read",
        opened(["timestamp tx ty tz qx qy qz qw", *text(rows())], truth()),
    ),
    Case(
        "41c",
        "EuRoC's csv: ns, w first, 17 columns",
        "refused",
        "read by the names in the header",
        opened(euroc(), truth()),
    ),
    Case(
        "41d",
        "rows of NaN",
        "refused",
        "no ground truth for these scans, and reported",
        opened(text(changed(rows(), slice(3, 5), np.nan, slice(1, 8))), truth("unknown pose", known=without(3, 4))),
    ),
    Case(
        "41e",
        "quaternions of zeros",
        "refused",
        "no ground truth for these scans, and reported",
        opened(text(changed(rows(), 7, 0, slice(4, 8))), truth("unknown pose", known=without(7))),
    ),
    Case(
        "41f",
        "a repeated stamp",
        "refused",
        "the first row is used, and reported",
        opened(text(rows()[[*range(6), 5, *range(6, SCANS)]]), truth("unsorted truth")),
    ),
    Case(
        "41g",
        "quaternions with w first",
        "accepted without a message, every rotation wrong",
        "order estimated from the motion, and reported",
        opened(text(rows("wxyz")), truth("order of quaternions")),
    ),
    Case(
        "41h",
        "quaternions with w first, stated in sensor.yaml",
        "no such key",
        "read as stated",
        opened(text(rows("wxyz")), truth(), "quaternion: wxyz\n"),
    ),
    Case(
        "41i",
        "a header that names w first",
        "refused",
        "read as the header states",
        opened(["# stamp tx ty tz qw qx qy qz", *text(rows("wxyz"))], truth()),
    ),
    Case(
        "41j",
        "w first, and too few poses for an estimate",
        "accepted without a message",
        "no ground truth before the odometry determines the order; the key is named",
        opened(
            text(rows("wxyz", START + 10 * np.arange(3), POSES[:300:100])),
            no_truth("poses shorter than scans", "unclear quaternions"),
        ),
    ),
    Case(
        "41k",
        "quaternions of length 0.5",
        "accepted without a message",
        "refused; the message names the line",
        refused(text(changed(rows(), slice(2, None), 0.25, slice(4, 8))), "line 3", "length 0.5"),
    ),
    Case(
        "41l",
        "a mirrored rotation in KITTI's format",
        "accepted without a message",
        "refused; the message names the line",
        refused(mirrored(), "line 5", "mirrored"),
    ),
    Case(
        "41m",
        "a 3x3 part that is not a rotation",
        "accepted without a message",
        "refused; the message names the line",
        refused(text(changed(kitti(), 9, 2.0, slice(0, 1))), "line 10", "not orthonormal"),
    ),
    Case(
        "41n",
        "a truncated line",
        "refused without the line",
        "refused; the message names the line",
        refused([*text(rows())[:-1], "1029.9 1 2"], "line 300 has 3 values"),
    ),
    Case(
        "41o",
        "decimal commas",
        "refused",
        "read",
        opened([line.replace(".", ",") for line in text(rows())], truth()),
    ),
    Case(
        "41p",
        "a byte order mark, semicolons and blank lines",
        "refused",
        "read",
        opened(["\ufeff# made by a spreadsheet", "", *text(rows(), "; ")], truth()),
    ),
    Case(
        "41q",
        "a straight road in TUM's format",
        "right",
        "read in TUM's order, since the LiDAR faces forward",
        opened(text(rows(poses=LINE)), truth(poses=LINE)),
    ),
    Case(
        "41r",
        "a text file without poses",
        "refused",
        "refused; the message quotes the first words",
        refused(["see the readme"], "not a table of numbers", "see the readme"),
    ),
    Case(
        "R11",
        "rows of zeros for lost poses in KITTI's format",
        "a traceback after the odometry; loops and map were lost",
        "no ground truth for these scans",
        opened(text(changed(kitti(), slice(5, 8), 0)), truth("unknown pose", known=without(5, 6, 7))),
    ),
    Case(
        "44",
        "17 columns, the first a frame number (KITTI-360)",
        "refused",
        "assigned by number; the other scans have no ground truth",
        opened(numbered(17), truth("poses shorter than scans", known=np.arange(10, SCANS, 5))),
    ),
    Case(
        "44b",
        "the same with 13 columns",
        "refused",
        "assigned by number; the other scans have no ground truth",
        opened(numbered(13), truth("poses shorter than scans", known=np.arange(10, SCANS, 5))),
    ),
    Case(
        "45b",
        "a gap of twenty seconds in the ground truth",
        "interpolated across the gap, without a message",
        "no ground truth within the gap, and reported",
        opened(text(rows()[without(*range(50, 250))]), truth("hole in ground truth", known=without(*range(50, 250)))),
    ),
    Case(
        "45c",
        "ground truth at 1 Hz",
        "interpolated",
        "interpolated: one second is the usual step of this file",
        opened(text(rows()[ONE_HZ]), truth("poses shorter than scans", known=slice(0, 291), poses=COARSE)),
    ),
    Case(
        "45d",
        "ground truth at 100 Hz",
        "right",
        "interpolated at the scans' stamps",
        opened(text(rows(stamps=FINE, poses=se3.interpolate(STAMPS, POSES, FINE))), truth()),
    ),
    Case(
        "45e",
        "ground truth shorter than the sequence",
        "right",
        "no ground truth for the other scans, and reported",
        opened(text(rows()[:120]), truth("poses shorter than scans", known=slice(0, 120))),
    ),
    Case(
        "45f",
        "decreasing stamps",
        "refused",
        "sorted, and reported",
        opened(text(rows()[::-1]), truth("unsorted truth")),
    ),
    Case(
        "45g",
        "stamps in nanoseconds",
        "no ground truth for any scan",
        "unit estimated from the values",
        opened(nanoseconds(), truth()),
    ),
    Case(
        "45h",
        "ground truth on another clock",
        "no ground truth for any scan, reported as too short",
        "no ground truth; both time spans are reported",
        opened(text(rows(stamps=STAMPS + 5e5)), no_truth("no ground truth")),
    ),
    Case(
        "45i",
        "fewer rows than scans, with scans missing",
        "assigned row by row, without a message",
        "no ground truth, and reported",
        fewer_rows,
    ),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_ground_truth(case: Case, bench: Bench) -> None:
    case.play(bench)
