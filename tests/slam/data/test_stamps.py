"""Stamps that make no sense beside those before them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.data.cloud import Frame, PointCloud
from slam.data.stamp_digits import seconds_of, seconds_of_pairs
from slam.data.stamps import mended, stamp_problems, usual_step

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


# ---- of a whole drive


@given(st.lists(st.one_of(st.integers(-30, 300), st.none()), min_size=2, max_size=12))
def test_mended_stamps_rise(tenths: list[int | None]) -> None:
    stamps = np.array([np.nan if tenth is None else tenth / 10 for tenth in tenths])
    step = usual_step(stamps)
    found, problems = mended(stamps, "times.txt")
    assert len(found) == len(stamps)
    if step is not None:
        assert (np.diff(found) > 0).all()
        sound = np.isfinite(stamps).all() and (np.diff(stamps) > 0).all()
        assert bool(problems) is not sound
        assert not sound or (found == stamps).all()


def test_what_was_mended_is_one_line() -> None:
    stamps = np.array([0, 0.1, np.nan, 0.3, 0.4, 0.4, 0.6, 0.0, 0.1])
    found, (problem,) = mended(stamps, "times.txt")
    assert found == pytest.approx(0.1 * np.arange(9))
    assert problem.kind == "mended stamps"
    assert problem.message == (
        "times.txt: stamps missing, repeated or apart from the others at scans 2, 5 (from 0): put between these; "
        "the clock was set back at scan 7 (from 0): the rest follows one usual step later"
    )


def test_stamps_ahead_stay() -> None:
    stamps = np.array([0, 0.1, 60, 60.1])
    assert mended(stamps, "times.txt") == (stamps, ())


@pytest.mark.parametrize(
    ("values", "unit"),
    [
        ([1_700_000_000, 1_700_000_001], "s"),
        ([1_700_000_000_000, 1_700_000_000_100], "ms"),
        ([1_700_000_000_000_000, 1_700_000_000_100_000], "us"),
        ([1_700_000_000_000_000_000, 1_700_000_000_100_000_000], "ns"),
        ([0.0, 0.1], "s"),
        ([0, 50], "ms"),
        ([0, 50_000], "us"),
        ([0, 100_000_000], "ns"),
    ],
)
def test_units_follow_from_the_epoch_or_the_steps(values: list[int | float], unit: str) -> None:
    assert seconds_of(values)[1] == unit


def test_seconds_are_exact_to_the_last_bit() -> None:
    assert seconds_of([1_662_622_237_123_456_789])[0][0] == 1662622237.123456789
    assert seconds_of_pairs(["1662622237"], ["123456789"], point=False)[0][0] == 1662622237.123456789


def test_what_follows_seconds_is_a_fraction_or_a_count() -> None:
    whole = ["1700000000"] * 4
    stripped = seconds_of_pairs(whole, ["1", "2", "3", "400000001"], point=True)
    counted = seconds_of_pairs(whole, ["50000000", "150000000", "250000000", "350000000"], point=True)
    assert stripped[0] - 1.7e9 == pytest.approx([0.1, 0.2, 0.3, 0.4], abs=1e-6)
    assert counted[0] - 1.7e9 == pytest.approx([0.05, 0.15, 0.25, 0.35], abs=1e-6)
