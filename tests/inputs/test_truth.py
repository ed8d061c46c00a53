"""Inputs that caused errors in similar tools or earlier versions: ground truth, poses, images and interrupted runs.

Each case states the result of earlier versions and the result now, which `play` checks.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import gtsam
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.data.images import ImageFile
from slam.data.point_files import read_points
from slam.data.pose_files import kitti_text, read_poses, tum_text
from slam.graph.g2o import write_g2o
from slam.graph.pose_graph import Edge, PoseGraph
from slam.graph.solver import squared_distances
from slam.pipeline import Pipeline
from slam.run import Run

SCANS, START = 300, 1.7e9
STAMPS = START + 0.1 * np.arange(SCANS)
#: T_world_lidar: half a metre per scan along x, in bends.
POSES = np.array([se3.exp(np.array([0, 0, 0.3 * np.sin(k / 40), 0, 0, 0])) for k in range(SCANS)])
POSES[1:, :2, 3] = np.cumsum(0.5 * POSES[:-1, :2, 0], axis=0)
#: Rotation to the axes of camera 0 (x right, y down, z forward), and a lever arm.
T_CAMERA_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])
CALIBRATION = """K: [[700, 0, 600], [0, 700, 180], [0, 0, 1]]
T_camera_lidar: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
"""


@dataclass(frozen=True)
class Bench:
    """Fixtures of a case.

    Attributes:
        folder: A sequence of SCANS scans of three points each, with times.txt.
        lidarlift: The command, in this process.
        street: Writes the short sequence in KITTI's layout.
        street_poses: True poses of this sequence.
        street_scans: Scans of this sequence, (N, 4) float32.
    """

    folder: Path
    lidarlift: Callable[..., Any]
    street: Callable[..., Path]
    street_poses: Array
    street_scans: list[Array]

    def poses(self, *lines: str) -> None:
        (self.folder / "poses.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


Play = Callable[[Bench], None]


@dataclass(frozen=True)
class Case:
    """One input.

    Attributes:
        number: Number of the input (41), of a similar one (41b), or of a finding of a review (R12).
        title: Property of the input.
        before: Result of earlier versions.
        now: Result.
        play: Writes the input and checks the result.
    """

    number: str
    title: str
    before: str
    now: str
    play: Play

    def __str__(self) -> str:
        return f"{self.number} {self.title}".replace(" ", "-")


# -- ground truth -----------------------------------------------------------------------------------------------


def rows(order: str = "xyzw", stamps: Array = STAMPS, poses: Array = POSES) -> Array:
    """(N, 8): stamp, position, quaternion."""
    quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return np.column_stack([stamps, poses[:, :3, 3], quaternion if order == "xyzw" else quaternion[:, [3, 0, 1, 2]]])


def text(table: Array, comma: str = " ") -> list[str]:
    return [comma.join(f"{value:.9g}" if k else f"{value:.3f}" for k, value in enumerate(row)) for row in table]


def truth(*kinds: str, known: Array | slice = slice(None), poses: Array = POSES) -> Callable[[Dataset], None]:
    """Check that exactly the scans `known` have the ground truth `poses`, and that the problems are of these kinds."""

    def check(data: Dataset) -> None:
        assert [problem.kind for problem in data.problems] == list(kinds)
        found = data.ground_truth
        assert found is not None
        having = np.isfinite(found[:, 0, 0])
        expected = np.zeros(len(data), bool)
        expected[known] = True
        np.testing.assert_array_equal(having, expected)
        first = np.argmax(having)
        np.testing.assert_allclose(found[having], (se3.inverse(poses[first]) @ poses)[having], atol=2e-3)

    return check


def no_truth(*kinds: str) -> Callable[[Dataset], None]:
    def check(data: Dataset) -> None:
        assert [problem.kind for problem in data.problems] == list(kinds)
        assert data.ground_truth is None

    return check


def opened(
    lines: Sequence[str], check: Callable[[Dataset], None], sensor: str | None = None
) -> Callable[[Bench], None]:
    """Open the sequence with these lines as poses.txt."""

    def play(bench: Bench) -> None:
        bench.poses(*lines)
        if sensor:
            (bench.folder / "sensor.yaml").write_text(sensor)
        check(open_dataset(bench.folder))

    return play


def refused(lines: Sequence[str], *words: str) -> Play:
    def play(bench: Bench) -> None:
        bench.poses(*lines)
        with pytest.raises(InputError, match=r"poses\.txt") as error:
            open_dataset(bench.folder)
        assert all(word in str(error.value) for word in words), str(error.value)

    return play


def changed(values: Array, at: int | slice, to: float, columns: slice = slice(None)) -> Array:
    table = values.copy()
    table[at, columns] = to
    return table


def without(*gone: int) -> Array:
    return np.setdiff1d(np.arange(SCANS), gone)


def euroc() -> list[str]:
    header = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
    header += "".join(f", {name}_{axis} [u]" for name in ("v_RS_R", "b_w_RS_S", "b_a_RS_S") for axis in "xyz")
    table = rows("wxyz")[:, 1:]
    lines = [
        ",".join([f"{int(1000 * stamp) * 10**6}", *map(str, row), *["0.1"] * 9])
        for stamp, row in zip(STAMPS, table, strict=True)
    ]
    return [header, *lines]


def kitti() -> Array:
    return POSES[:, :3].reshape(-1, 12).copy()


def nanoseconds() -> list[str]:
    lines = zip(STAMPS, text(rows()), strict=True)
    return [f"{round(10 * stamp)}00000000 {line.partition(' ')[2]}" for stamp, line in lines]


def numbered(columns: int) -> list[str]:
    """KITTI-360's format: the frame number first; every fifth frame from the tenth."""
    full = POSES.reshape(-1, 16)[:, : columns - 1]
    return [" ".join([str(k), *map(str, full[k])]) for k in range(10, SCANS, 5)]


def mirrored() -> list[str]:
    table = kitti()
    table[4, [1, 5, 9]] *= -1
    return text(table)


ONE_HZ = np.arange(0, SCANS, 10)
COARSE = se3.interpolate(STAMPS[ONE_HZ], POSES[ONE_HZ], STAMPS)
FINE = START + 0.01 * np.arange(10 * SCANS)
LINE = np.tile(np.eye(4), (SCANS, 1, 1))
LINE[:, 0, 3] = np.arange(SCANS)

TRUTH = [
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
        lambda bench: fewer_rows(bench),
    ),
]


def fewer_rows(bench: Bench) -> None:
    for number in (20, 21, 22):
        (bench.folder / f"{number:06d}.bin").unlink()
    (bench.folder / "times.txt").write_text("".join(f"{stamp}\n" for stamp in np.delete(STAMPS, [20, 21, 22])))
    bench.poses(*text(kitti()[:280]))
    no_truth("gap in numbering", "no ground truth")(open_dataset(bench.folder))


def no_stamps(bench: Bench) -> None:
    (bench.folder / "times.txt").unlink()
    bench.poses(*text(rows(stamps=FINE[:SCANS])))
    no_truth("no time stamps", "no ground truth")(open_dataset(bench.folder))


def short_drive(bench: Bench, *lines: str) -> Run:
    """Run the street's scans as a folder of point files, with these lines as poses.txt."""
    folder = bench.folder / "short"
    folder.mkdir()
    for number in range(8):
        source = bench.street_scans[number]
        source.tofile(folder / f"{number:06d}.bin")
    (folder / "times.txt").write_text("".join(f"{0.1 * number}\n" for number in range(8)))
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
    return Pipeline().run(open_dataset(folder))


def odometry_tells(bench: Bench) -> None:
    stamps = 0.1 * np.arange(8)
    run = short_drive(bench, *text(rows("wxyz", stamps, bench.street_poses)))
    assert [problem.kind for problem in run.problems] == ["order of quaternions"]
    assert run.ground_truth is not None
    np.testing.assert_allclose(run.ground_truth, bench.street_poses, atol=1e-5)


def header_lies(bench: Bench) -> None:
    table = text(rows("wxyz", 0.1 * np.arange(8), bench.street_poses))
    run = short_drive(bench, "# stamp tx ty tz qx qy qz qw", *table)
    assert [problem.kind for problem in run.problems] == ["order of quaternions"]
    assert "by the odometry, its quaternions have w first" in run.problems[0].message
    assert run.ground_truth is not None
    np.testing.assert_allclose(run.ground_truth, bench.street_poses, atol=1e-5)


def nobody_tells(bench: Bench) -> None:
    """The body's x axis points up and it rotates about x: neither order agrees with the LiDAR's motion."""
    turn = se3.exp(np.array([0, -np.pi / 2, 0, 0, 0, 0])) @ se3.exp(np.array([1.0, 0, 0, 0, 0, 0]))
    run = short_drive(bench, *text(rows("xyzw", 0.1 * np.arange(8), bench.street_poses @ turn)))
    assert [problem.kind for problem in run.problems] == ["no ground truth"]
    assert "write quaternion" in run.problems[0].message
    assert run.ground_truth is None


def cameras_truth(bench: Bench) -> None:
    run = short_drive(
        bench, *text((T_CAMERA_LIDAR @ bench.street_poses @ se3.inverse(T_CAMERA_LIDAR))[:, :3].reshape(-1, 12))
    )
    assert [problem.kind for problem in run.problems] == ["no ground truth"]
    assert "as a camera does" in run.problems[0].message
    assert run.ground_truth is None


def zeros_in_a_run(bench: Bench) -> None:
    path = bench.street()
    poses = path.parent.parent / "poses" / "77.txt"
    lines = poses.read_text().splitlines()
    poses.write_text("\n".join([*lines[:3], " ".join(["0"] * 12), *lines[4:]]) + "\n")
    result = bench.lidarlift("run", path, "--frames", ":5", "--out", "r")
    assert result.code == 0, result.err
    assert len(read_poses(Path("r/ground_truth_tum.txt"))[1]) == 4
    assert "unknown pose" in result.err


def cameras_odometry(bench: Bench) -> None:
    path = bench.street()
    (bench.folder / "poses_of_camera.txt").write_text((path.parent.parent / "poses" / "77.txt").read_text())
    result = bench.lidarlift("run", path, "--odometry", bench.folder / "poses_of_camera.txt", "--out", "r")
    assert result.code == 0, result.err
    assert "converted by the calibration of KITTI's camera 0" in result.err
    np.testing.assert_allclose(read_poses(Path("r/odometry_kitti.txt"))[1], bench.street_poses, atol=1e-5)
    (path / "calib.txt").unlink()
    bench.lidarlift("run", path, "--odometry", bench.folder / "poses_of_camera.txt", "--out", "s").refused(
        "poses_of_camera.txt", "they are those of a camera", "give LiDAR poses"
    )


def truth_of_a_lidar(bench: Bench) -> None:
    path = bench.street()
    (path.parent.parent / "poses" / "77.txt").write_text(kitti_text(bench.street_poses))
    data = open_dataset(path)
    assert data.ground_truth is None
    assert "of camera 0, along z" in data.problems[-1].message


def sound_and_unsound(_: Bench) -> None:
    poses = np.array([np.eye(4), np.zeros((4, 4)), np.full((4, 4), np.nan), np.diag([1.0, 1, -1, 1])])
    lines = tum_text(np.arange(4.0), poses).splitlines()
    assert lines[0] == "0.000000000 0 0 0 0 0 0 1"
    assert [line.split()[1:] for line in lines[1:]] == [["nan"] * 7] * 3
    assert len(kitti_text(poses).splitlines()) == 4


def gtsam_reads(bench: Bench) -> None:
    rng, path = np.random.default_rng(5), bench.folder / "graph.g2o"
    poses = np.array([se3.exp(rng.normal(size=6) * [1, 1, 1, 50, 50, 5]) for _ in range(5)])
    edges = []
    for i, j in ((0, 1), (1, 2), (2, 3), (3, 4), (0, 4)):
        A, off = rng.normal(size=(6, 6)), se3.exp(0.1 * rng.normal(size=6))
        edges.append(Edge(i, j, se3.inverse(poses[i]) @ poses[j] @ off, A @ A.T + 0.1 * np.eye(6)))
    write_g2o(path, PoseGraph(poses, tuple(edges)))
    graph, values = gtsam.readG2o(str(path), is3D=True)
    assert (graph.size(), values.size()) == (5, 5)
    assert 2 * graph.error(values) == pytest.approx(squared_distances(edges, poses).sum(), rel=1e-9)


def world_frame(bench: Bench) -> None:
    """A street of houses, seen within 30 m, over 70 m, with the points in the world frame."""
    rng, parts = np.random.default_rng(0), []
    for x in np.arange(-40, 120, 10.0):
        for side in (-1, 1):
            wide, y = rng.uniform(4, 9), side * rng.uniform(8, 14)
            parts.append(np.column_stack([rng.uniform(x, x + wide, 400), np.full(400, y), rng.uniform(-1.7, 7, 400)]))
            parts.append(
                np.column_stack([np.full(200, x), y + side * rng.uniform(0, 5, 200), rng.uniform(-1.7, 7, 200)])
            )
    parts.append(np.column_stack([rng.uniform(-40, 120, 8_000), rng.uniform(-20, 20, 8_000), np.full(8_000, -1.7)]))
    world = np.concatenate(parts)
    for name in ("world", "own"):
        (bench.folder / name).mkdir()
        for number in range(24):
            here = np.array([3.0 * number, 0, 0])
            seen = world[np.linalg.norm(world - here, axis=1) < 30] - (here if name == "own" else 0)
            np.column_stack([seen, np.full(len(seen), 0.5)]).astype("f4").tofile(bench.folder / name / f"{number}.bin")
        (bench.folder / name / "times.txt").write_text("".join(f"{0.1 * number}\n" for number in range(24)))
        problems = [problem.kind for problem in Pipeline().run(open_dataset(bench.folder / name)).problems]
        assert problems == (["world frame"] if name == "world" else [])


POSES_AND_GRAPHS = [
    Case(
        "37",
        "scans that are already in the world frame",
        "no motion and a plausible map, without a message",
        "reported once per run",
        world_frame,
    ),
    Case(
        "41s",
        "w first, and too few poses for an estimate, in a run",
        "accepted without a message",
        "the odometry determines the order, and it is reported",
        odometry_tells,
    ),
    Case(
        "41u",
        "a header that states w last, and quaternions with w first",
        "refused",
        "the odometry contradicts the header, and it is reported",
        header_lies,
    ),
    Case(
        "41t",
        "poses of a body with other axes: neither order agrees with the odometry",
        "accepted without a message",
        "no ground truth; the key is named",
        nobody_tells,
    ),
    Case(
        "R12",
        "ground truth with stamps, scans without times.txt",
        "assigned row by row, 100 Hz poses to 10 Hz scans, without a message",
        "no ground truth, and reported",
        no_stamps,
    ),
    Case(
        "R11b",
        "a row of zeros in KITTI's odometry benchmark",
        "a traceback after the odometry",
        "the run completes; no ground truth for this scan, and reported",
        zeros_in_a_run,
    ),
    Case("R11c", "writing of invalid poses", "a traceback", "rows of NaN after their stamps", sound_and_unsound),
    Case(
        "R13",
        "--odometry with poses of camera 0",
        "a map three times too large, without a message",
        "converted by the calibration, and reported; refused without a calibration",
        cameras_odometry,
    ),
    Case(
        "R13b",
        "poses.txt with poses of a camera",
        "errors between different bodies, with a note",
        "no ground truth once the odometry shows it",
        cameras_truth,
    ),
    Case(
        "R13c",
        "the LiDAR's poses in place of KITTI's camera 0",
        "converted to wrong poses, without a message",
        "no ground truth, and reported",
        truth_of_a_lidar,
    ),
    Case("46", "graph.g2o read by GTSAM", "not tested", "the same chi-squared", gtsam_reads),
]


# -- images and calibration ----------------------------------------------------------------------------------------


def pictures(bench: Bench, names: Sequence[str], *, times: Sequence[float] = (), calibrated: bool = True) -> Path:
    folder = bench.folder / "images"
    folder.mkdir(exist_ok=True)
    for number, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full((4, 6, 3), number % 250, np.uint8))
    if times:
        (folder / "times.txt").write_text("".join(f"{stamp}\n" for stamp in times))
    if calibrated:
        (bench.folder / "calib.yaml").write_text(CALIBRATION)
    return folder


def shades(data: Dataset, positions: Sequence[int]) -> list[int | None]:
    images = [data[position].image for position in positions]
    return [None if image is None else int(image[0, 0, 0]) for image in images]


def image_kinds(data: Dataset, position: int) -> list[str]:
    return [problem.kind for problem in data[position].problems]


def fewer_images(bench: Bench) -> None:
    pictures(bench, [f"{number:06d}.png" for number in range(5)])
    data = open_dataset(bench.folder)
    assert shades(data, [0, 4, 5]) == [0, 4, None]
    assert image_kinds(data, 5) == ["missing image"]


def images_by_number(bench: Bench) -> None:
    pictures(bench, [f"frame{number}.png" for number in range(12)])
    assert shades(open_dataset(bench.folder), [0, 2, 11]) == [0, 2, 11]


def images_of_other_names(bench: Bench) -> None:
    pictures(bench, ["left.png", "right.png"])
    data = open_dataset(bench.folder)
    assert [problem.kind for problem in data.problems] == ["unmatched images"]
    assert image_kinds(data, 0) == []


def a_faster_camera(bench: Bench) -> None:
    """Thirty images per second, from one second before the scans, over half of the sequence."""
    times = START - 1 + np.arange(480) / 30
    pictures(bench, [f"{number}.png" for number in range(480)], times=times.tolist())
    data = open_dataset(bench.folder)
    assert shades(data, [0, 1, 10, 200]) == [30, 33, 60, None]


def images_named_by_stamps(bench: Bench) -> None:
    """Names in nanoseconds since 1970, 20 ms after every other scan."""
    pictures(bench, [f"{round((stamp + 0.02) * 1e3)}000000.png" for stamp in STAMPS[:20:2]])
    data = open_dataset(bench.folder)
    assert shades(data, [0, 2, 18]) == [0, 1, 9]
    assert image_kinds(data, 1) == ["missing image"]


def namesakes_first(bench: Bench) -> None:
    """Scans and images are named by the same stamps, and times.txt counts from 0."""
    folder = bench.folder / "named"
    (folder / "images").mkdir(parents=True)
    for number in range(5):
        name = f"{round(STAMPS[number] * 10)}00000000"
        (folder / f"{name}.bin").write_bytes((bench.folder / "000000.bin").read_bytes())
        cv2.imwrite(str(folder / "images" / f"{name}.png"), np.full((4, 6, 3), number, np.uint8))
    (folder / "times.txt").write_text("0\n0.1\n0.2\n0.3\n0.4\n")
    assert shades(open_dataset(folder), range(5)) == [0, 1, 2, 3, 4]


def many_images(_: Bench) -> None:
    from slam.data import images

    stamps = 0.1 * np.arange(36_000)
    files = [Path(f"{number}.png") for number in range(36_000)]
    tracemalloc.start()
    found = images.nearest_images(files, stamps + 0.01, stamps)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found == files
    assert peak < 20e6


def damaged_images(bench: Bench) -> None:
    folder = pictures(bench, [f"{number:06d}.png" for number in range(4)])
    rng = np.random.default_rng(0)
    cv2.imwrite(str(folder / "000001.png"), rng.integers(0, 255, (60, 80, 3), np.uint8))
    whole = (folder / "000001.png").read_bytes()
    (folder / "000000.png").write_bytes(b"no image at all")
    (folder / "000002.png").write_bytes(whole[: len(whole) // 2])
    (folder / "000003.png").write_bytes(whole[:200] + bytes(300) + whole[500:])
    data = open_dataset(bench.folder)
    frames = [data[position] for position in range(4)]
    kinds = [[problem.kind for problem in frame.problems] for frame in frames]
    assert kinds == [["damaged image"], [], ["damaged image"], []]
    assert [frame.image is None for frame in frames] == [True, False, True, True]
    inside = frames[3].read_image
    assert isinstance(inside, ImageFile)
    assert inside.problem is not None
    assert "000003.png: wrong checksum inside" in inside.problem.message


def damage_in_a_run(bench: Bench) -> None:
    """The first image is damaged in its pixels only, and is read to colour the map."""
    path = bench.street()
    (path / "image_2").mkdir()
    rng = np.random.default_rng(0)
    for number in range(8):
        cv2.imwrite(str(path / "image_2" / f"{number:06d}.png"), rng.integers(0, 255, (60, 80, 3), np.uint8))
    first = path / "image_2" / "000000.png"
    whole = first.read_bytes()
    first.write_bytes(whole[:200] + bytes(300) + whole[500:])
    run = Pipeline().run(open_dataset(path), slice(3))
    assert run.counts()["damaged_image"] == 1
    first.write_bytes(whole[:5000])
    result = bench.lidarlift("run", path, "--frames", ":3", "--strict", "--out", "r")
    assert result.code == 1
    assert "000000.png: cut short" in result.err


def orientation_tag(bench: Bench) -> None:
    path = bench.folder / "turned.jpg"
    encoded = cv2.imencode(".jpg", np.zeros((20, 40, 3), np.uint8))[1].tobytes()
    exif = (
        b"Exif\x00\x00II*\x00\x08\x00\x00\x00\x01\x00\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00\x00\x00\x00\x00"
    )
    path.write_bytes(encoded[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + encoded[2:])
    turned = cv2.imread(str(path))
    assert turned is not None
    assert turned.shape == (40, 20, 3)  # the tag is one that OpenCV would follow
    image = ImageFile(path)()
    assert image is not None
    assert image.shape == (20, 40, 3)


def sixteen_bits(bench: Bench) -> None:
    grey = np.arange(256, dtype=np.uint16).reshape(16, 16)
    for bits in (8, 12, 16):
        path = bench.folder / f"{bits}.png"
        cv2.imwrite(str(path), grey.astype(np.uint8) if bits == 8 else grey << (bits - 8))
        image = ImageFile(path)()
        assert image is not None
        np.testing.assert_array_equal(image[:, :, 1], grey)


def fisheye(bench: Bench) -> None:
    path = bench.folder / "calib.yaml"
    path.write_text(CALIBRATION + "distortion: [-0.03, 0.02, -0.05, 0.03]\n")
    with pytest.raises(InputError, match=r"may be k1 k2 k3 k4 of a fisheye lens.*say model: pinhole"):
        open_dataset(bench.folder)
    path.write_text(CALIBRATION + "distortion: [-0.03, 0.02, -0.05, 0.03]\nmodel: equidistant\n")
    calibration = open_dataset(bench.folder).calibration
    assert calibration is not None
    assert calibration.fisheye
    path.write_text(CALIBRATION + "distortion: [-0.03, 0.02, -0.05, 0.03]\nmodel: plumb_bob\n")
    calibration = open_dataset(bench.folder).calibration
    assert calibration is not None
    assert not calibration.fisheye
    path.write_text(CALIBRATION + "model: omnidirectional\n")
    with pytest.raises(InputError, match="unknown model 'omnidirectional'; known: pinhole"):
        open_dataset(bench.folder)


def odd_sizes(bench: Bench) -> None:
    path = bench.street()
    (path / "image_2").mkdir()
    for number in range(3):
        cv2.imwrite(str(path / "image_2" / f"{number:06d}.png"), np.full((369, 1225, 3), 90, np.uint8))
    methods = [word for name in ("ip-basic", "f2l", "joint") for word in ("--method", name)]
    result = bench.lidarlift("depth-benchmark", path, "--frames", "1:2", "--out", "d", *methods)
    assert result.code == 0, result.err


IMAGES = [
    Case("48", "images of 1225 x 369 pixels", "not tested", "every method completes their depth", odd_sizes),
    Case("49", "fewer images than scans", "not tested", "no image for the other scans, and reported", fewer_images),
    Case(
        "49b",
        "images with the numbers of the scans, but other names",
        "no image for any scan",
        "matched by number",
        images_by_number,
    ),
    Case(
        "49c",
        "images without any relation to the scans",
        "no image for any scan",
        "reported once per sequence",
        images_of_other_names,
    ),
    Case(
        "49d",
        "a camera at 30 Hz that starts and stops earlier",
        "right",
        "the nearest image within half a scan period",
        a_faster_camera,
    ),
    Case(
        "49e",
        "images named by stamps, scans named by numbers",
        "no image for any scan",
        "the nearest in time",
        images_named_by_stamps,
    ),
    Case(
        "49f",
        "scans and images named by the same stamps, times.txt from 0",
        "matched by name",
        "matched by name",
        namesakes_first,
    ),
    Case("R15", "an hour of images matched by time", "16 bytes per pair: 21 GB", "a few megabytes", many_images),
    Case(
        "R23a",
        "damaged images",
        "a line in the log, not counted",
        "reported; no partial image is used",
        damaged_images,
    ),
    Case(
        "R23b",
        "an image damaged in its pixels, in a run",
        "not counted; --strict did not stop",
        "counted; --strict stops",
        damage_in_a_run,
    ),
    Case(
        "R23c",
        "a JPEG with an orientation tag",
        "rotated, so that K did not match",
        "pixels as stored",
        orientation_tag,
    ),
    Case(
        "R23d", "16-bit images", "nearly black for a 12-bit camera", "scaled to 8 bits by the bits in use", sixteen_bits
    ),
    Case(
        "R23e",
        "coefficients of a fisheye lens",
        "read as k1 k2 p1 p2",
        "read as `model` states, else required",
        fisheye,
    ),
]


# -- interrupted runs and output -------------------------------------------------------------------------------------

STOPPED = """
import signal, sys, time
from lidarlift.cli import main
from slam.tracking import Tracker

track = Tracker.__call__

def slow(self, frame):
    if frame.index == 4:
        print("there", flush=True)
        time.sleep(600)
    return track(self, frame)

Tracker.__call__ = slow
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells have what they start in the background ignore it
main()
"""


def stopped_by_an_exception(bench: Bench) -> None:
    path = bench.street()
    data = open_dataset(path)

    class Broken:
        def __getattr__(self, name: str) -> Any:
            return getattr(data, name)

        def __len__(self) -> int:
            return len(data)

        def __getitem__(self, position: int) -> Any:
            if position == 5:
                raise MemoryError("a header that lies")
            return data[position]

    import lidarlift

    lidarlift.run(data, frames=slice(2), out=bench.folder / "earlier")
    before = (bench.folder / "earlier" / "trajectory_tum.txt").read_bytes()
    for name, kept in (("r", "r"), ("earlier", "earlier-stopped")):
        with pytest.raises(MemoryError):
            lidarlift.run(Broken(), out=bench.folder / name)
        assert len(read_poses(bench.folder / kept / "odometry_tum.txt")[1]) == 5
        assert len(read_poses(bench.folder / kept / "ground_truth_tum.txt")[1]) == 5
        assert not (bench.folder / kept / "run.json").exists()
    assert (bench.folder / "earlier" / "trajectory_tum.txt").read_bytes() == before


def stopped_by_hand(bench: Bench) -> None:
    folder = bench.folder / "r"
    command = [sys.executable, "-c", STOPPED, "run", str(bench.street()), "--out", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "there\n"
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 130
    assert "Traceback" not in err
    assert "stopped after 4 frames" in err
    assert len(read_poses(folder / "odometry_tum.txt")[1]) == 4


def onto_the_input(bench: Bench) -> None:
    path = bench.street()
    (bench.folder / "link").symlink_to(path)
    before = sorted(path.rglob("*"))
    for out in (path, path / "velodyne", path / "velodyne" / "more", bench.folder / "link", path / ".." / path.name):
        for command in (("run",), ("enrich", "--enricher", "ray-segment")):
            result = bench.lidarlift(*command, path, "--frames", ":1", "--out", out)
            result.refused(str(out), "choose another folder")
    bench.lidarlift("compare", path, "--frames", ":1", "--out", path).refused(str(path), "choose another folder")
    assert sorted(path.rglob("*")) == before
    own = bench.folder / "000000.bin"
    content = own.read_bytes()
    bench.lidarlift("enrich", bench.folder, "--sensor", "vlp16", "--out", bench.folder).refused("must not change")
    assert own.read_bytes() == content
    result = bench.lidarlift("enrich", path, "--enricher", "ray-segment", "--frames", ":1", "--out", path / "enriched")
    assert result.code == 0, result.err


def enriched_times(bench: Bench) -> None:
    path = bench.street()
    (path / "sensor.yaml").write_text("model: hdl64\n")  # as the sensor swept them: with times
    for suffix in ("pcd", "ply"):
        options = ("--enricher", "ray-segment", "--format", suffix, "--frames", ":1")
        assert bench.lidarlift("enrich", path, "--out", "e", *options).code == 0
        points = read_points(Path(f"e/000000.{suffix}"))
        cloud = open_dataset(path)[0].cloud
        assert cloud.time is not None
        times = points.times["time"]
        assert len(times) == len(points.xyz) > 2 * (len(cloud) // 4)
        assert times.min() == pytest.approx(cloud.time.min(), abs=0.01)
        assert times.max() == pytest.approx(cloud.time.max(), abs=0.01)


def off_the_lines(bench: Bench) -> None:
    noise = np.random.default_rng(0).normal(0, 20, (5000, 4)).astype("f4")
    path = bench.street({1: noise})
    result = bench.lidarlift("enrich", path, "--out", "e", "--frames", ":3", "--enricher", "ray-segment")
    assert result.code == 0, result.err
    assert sorted(file.name for file in Path("e").iterdir()) == ["000000.pcd", "000002.pcd"]
    assert "1 scans were empty, damaged or not on the laser lines" in result.out


def first_scan_of_few_points(bench: Bench) -> None:
    import lidarlift

    path, sizes = bench.street(), []
    whole = bench.street_scans[0]
    for first in (whole, whole[:: len(whole) // 40]):
        first.tofile(path / "velodyne" / "000000.bin")
        clouds = [cloud for _, cloud in lidarlift.enrich(path, enricher="ray-segment", frames=slice(3))]
        sizes.append(len(clouds[2]))
    assert sizes[1] == sizes[0]


LOST = [
    Case(
        "R5",
        "an exception during a run",
        "all poses were lost",
        "odometry, ground truth and timings are saved; a finished run in the folder is kept",
        stopped_by_an_exception,
    ),
    Case(
        "R5b",
        "Ctrl-C during a run",
        "all poses were lost",
        "poses are saved; the message names the folder",
        stopped_by_hand,
    ),
    Case(
        "R8",
        "output into the input folder",
        "scans overwritten, a map read as a scan",
        "refused, for any name of the folder",
        onto_the_input,
    ),
    Case("R17", "point times of enriched scans", "dropped", "written in the column time", enriched_times),
    Case(
        "R17b",
        "enrichment of a scan off the laser lines",
        "an AssertionError",
        "no file, and counted",
        off_the_lines,
    ),
    Case(
        "R18",
        "a first scan of forty points",
        "a coarse grid for all later scans",
        "no effect on the later scans",
        first_scan_of_few_points,
    ),
]

CASES = [*TRUTH, *POSES_AND_GRAPHS, *IMAGES, *LOST]


@pytest.fixture
def bench(
    tmp_path: Path,
    lidarlift: Callable[..., Any],
    street_drive: Callable[..., Path],
    street_poses: Array,
    street_scans: list[Array],
) -> Bench:
    folder = tmp_path / "drive"
    folder.mkdir()
    scan = np.array([[10, 0, 1, 0.5], [0, 10, 0, 0.25], [-10, 0, -1, 1]], np.float32).tobytes()
    for number in range(SCANS):
        (folder / f"{number:06d}.bin").write_bytes(scan)
    (folder / "times.txt").write_text("".join(f"{stamp:.6f}\n" for stamp in STAMPS))
    return Bench(folder, lidarlift, street_drive, street_poses, street_scans)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_ground_truth_images_and_interrupted_runs(case: Case, bench: Bench) -> None:
    case.play(bench)


def test_case_numbers_are_unique() -> None:
    assert len({case.number for case in CASES}) == len(CASES)
