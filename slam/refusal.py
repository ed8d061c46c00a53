"""What a run does not accept: times that cannot be seconds, and with `strict` any problem of the data."""

from __future__ import annotations

from collections.abc import Sequence

from slam.data.cloud import Frame
from slam.data.errors import InputError
from slam.data.problem import Problem

MIN_SWEEP = 0.04  # s; hardly any LiDAR rotates faster
MAX_SPAN = 5.0  # sweeps between the first and the last point of a scan


class RefusedError(InputError):
    """The data have a problem, and `strict` is set."""


def raise_if_strict(problems: Sequence[Problem], strict: bool) -> None:
    """Raise the first problem as a `RefusedError` if `strict` is set."""
    if strict and problems:
        raise RefusedError(problems[0].message)


def check_times(frame: Frame, sweep: float) -> None:
    """Refuse times that cannot be seconds relative to the stamp.

    Args:
        frame: The frame.
        sweep: Duration of a sweep [s].

    Raises:
        InputError: The points' times span many sweeps.
    """
    time = frame.cloud.time
    if time is None or len(time) == 0:
        return
    first, last = float(time.min()), float(time.max())
    if not last - first <= MAX_SPAN * max(sweep, MIN_SWEEP):
        raise InputError(
            f"frame {frame.index}: the points' times span {last - first:.3g} s, and a sweep takes about {sweep:.2g} s; "
            "give times in seconds relative to the stamp, not fractions of the sweep or other units"
        )
