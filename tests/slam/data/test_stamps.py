"""Stamps that make no sense beside those before them."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data.cloud import Frame, PointCloud
from slam.data.stamps import stamp_problems

NOTHING = PointCloud(np.zeros((0, 3)), np.zeros(0))


def frame(index: int, stamp: float) -> Frame:
    return Frame(index, stamp, NOTHING)


@pytest.mark.parametrize(
    ("index", "stamp"),
    [
        (8, 100.1),  # the next
        (8, 100.49),  # late
        (20, 101.3),  # twelve are missing, and the numbers say so
        (20, 106.0),  # the same, late
    ],
)
def test_stamps_that_rise_as_the_numbers_do_are_sound(index: int, stamp: float) -> None:
    assert stamp_problems(frame(index, stamp), frame(7, 100.0), 0.1) == ()


def test_a_first_stamp_may_be_anything() -> None:
    assert stamp_problems(frame(0, -1e9), None, 0.1) == ()


@pytest.mark.parametrize(
    ("stamp", "kind", "message"),
    [
        (
            100.0,
            "repeated stamp",
            "frame 8: its stamp, 100.000 s, is that of the frame before; "
            "one sweep, 0.1 s, is taken for the time between them",
        ),
        (
            99.75,
            "backward stamp",
            "frame 8: its stamp, 99.750 s, is 0.250 s before that of the frame before; "
            "one sweep, 0.1 s, is taken for the time between them",
        ),
        (
            100.75,
            "stamp jump",
            "frame 8: its stamp, 100.750 s, is 0.750 s after that of frame 7; "
            "scans are missing, or the clock was set; the time is taken as it is",
        ),
    ],
)
def test_what_is_wrong_is_one_line(stamp: float, kind: str, message: str) -> None:
    (problem,) = stamp_problems(frame(8, stamp), frame(7, 100.0), 0.1)
    assert (problem.kind, problem.message) == (kind, message)


def test_a_jump_beyond_what_the_numbers_explain() -> None:
    """Three scans later by the numbers, two seconds later by the clock."""
    (problem,) = stamp_problems(frame(10, 102.0), frame(7, 100.0), 0.1)
    assert problem.kind == "stamp jump"
