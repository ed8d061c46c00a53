"""Stamps that make no sense beside those before them."""

from __future__ import annotations

from typing import Protocol

from slam.data.problem import Problem

JUMP = 5.0  # times as long as the frame numbers say


class Stamped(Protocol):
    """A frame, or what is kept of it."""

    @property
    def index(self) -> int: ...
    @property
    def stamp(self) -> float: ...


def stamp_problems(frame: Stamped, before: Stamped | None, sweep: float) -> tuple[Problem, ...]:
    """A Problem where a frame's stamp repeats that of the frame before, lies before it, or jumps ahead.

    What the frame numbers explain is no jump: the data set itself says which scans are missing.

    Args:
        frame: The frame.
        before: The one before it, None before the first.
        sweep: Seconds from scan to scan, where none is missing.
    """
    if before is None:
        return ()
    elapsed, stamp = frame.stamp - before.stamp, f"frame {frame.index}: its stamp, {frame.stamp:.3f} s,"
    instead = f"one sweep, {sweep:.3g} s, is taken for the time between them"
    if elapsed == 0:
        return (Problem("repeated stamp", f"{stamp} is that of the frame before; {instead}"),)
    if elapsed < 0:
        return (Problem("backward stamp", f"{stamp} is {-elapsed:.3f} s before that of the frame before; {instead}"),)
    if elapsed > JUMP * sweep * max(frame.index - before.index, 1):
        late = f"is {elapsed:.3f} s after that of frame {before.index}"
        why = "scans are missing, or the clock was set; the time is taken as it is"
        return (Problem("stamp jump", f"{stamp} {late}; {why}"),)
    return ()
