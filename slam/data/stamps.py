"""Inconsistent stamps: corrected if the stamps of a whole sequence are known, else reported."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.problem import Problem, spans

JUMP = 5.0  # minimum factor between the elapsed time and that by the frame numbers


class Stamped(Protocol):
    """A frame, or a record of one."""

    @property
    def index(self) -> int:
        """Number of the frame in the data set."""

    @property
    def stamp(self) -> float:
        """Time stamp [s]."""


def stamp_problems(frame: Stamped, before: Stamped | None, sweep: float) -> tuple[Problem, ...]:
    """Return a Problem if a frame's stamp repeats that of the previous frame, lies before it, or jumps ahead.

    A step that the frame numbers explain is not a jump: the data set itself reports missing scans.

    Args:
        frame: The frame.
        before: The previous frame, None for the first.
        sweep: Scan period [s].
    """
    if before is None:
        return ()
    elapsed, stamp = frame.stamp - before.stamp, f"frame {frame.index}: its stamp, {frame.stamp:.3f} s,"
    instead = f"one sweep, {sweep:.3g} s, is used as the time between them"
    if elapsed == 0:
        return (Problem("repeated stamp", f"{stamp} repeats that of the previous frame; {instead}"),)
    if elapsed < 0:
        return (Problem("backward stamp", f"{stamp} is {-elapsed:.3f} s before that of the previous frame; {instead}"),)
    if elapsed > JUMP * sweep * max(frame.index - before.index, 1):
        late = f"is {elapsed:.3f} s after that of frame {before.index}"
        why = "scans are missing, or the clock was set; the stamp is used unchanged"
        return (Problem("stamp jump", f"{stamp} {late}; {why}"),)
    return ()


def usual_step(stamps: Array) -> float | None:
    """Return the scan period [s]: the median of the positive steps between stamps (N,), None if there are none."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else None


def mended(stamps: Array, where: object) -> tuple[Array, tuple[Problem, ...]]:
    """Correct stamps so that they increase.

    A stamp that is missing (NaN), repeats the one before or is an outlier is interpolated between its neighbours. If
    the clock was set back, all stamps after it are shifted so that they follow after one usual step. After a jump ahead
    the stamps are unchanged, since a clock that was set ahead cannot be distinguished from missing scans.

    Args:
        stamps: (N,) [s], at least two of which differ.
        where: Source of the stamps, for the message.

    Returns:
        Increasing stamps (N,) [s], and a Problem that lists the corrected ones.
    """
    step = usual_step(stamps)
    if step is None or (np.isfinite(stamps).all() and (np.diff(stamps) > 0).all()):
        return stamps, ()
    result = stamps.copy()
    wrong = [at for at in range(len(stamps)) if not np.isfinite(stamps[at])]
    set_back = []
    known = [at for at in range(len(stamps)) if np.isfinite(stamps[at])]
    place = 1
    while place < len(known):
        before, here = known[place - 1], known[place]
        if result[here] > result[before]:
            place += 1
            continue
        lead = place - 2  # decides whether the stamp before is too late or this one too early
        late = lead >= 0 and result[here] > result[known[lead]] and result[before] - result[known[lead]] > JUMP * step
        after = known[place + 1] if place + 1 < len(known) else None
        if late:
            wrong.append(known.pop(place - 1))
            place = max(place - 1, 1)
        elif after is None or result[after] > result[before]:
            wrong.append(known.pop(place))
        else:
            set_back.append(here)
            result[here:] += result[before] + step * (here - before) - result[here]
            place += 1
    result[wrong] = _interpolated(np.array(known), result[known], np.array(wrong, np.int64), step)
    return result, (Problem("mended stamps", _message(where, sorted(wrong), set_back)),)


def _interpolated(known: Array, stamps: Array, wrong: Array, step: float) -> Array:
    """Interpolate at the positions `wrong` between the stamps at `known`; extrapolate by one step per position."""
    inside = np.interp(wrong, known, stamps)
    return inside + step * (np.minimum(wrong - known[0], 0) + np.maximum(wrong - known[-1], 0))


def _message(where: object, wrong: list[int], set_back: list[int]) -> str:
    parts = []
    if wrong:
        parts.append(f"stamps missing, repeated or outlying at {_places(wrong)}: interpolated between the others")
    if set_back:
        parts.append(f"the clock was set back at {_places(set_back)}: the later stamps follow after one usual step")
    return f"{where}: {'; '.join(parts)}"


def _places(positions: list[int]) -> str:
    """Format positions of scans, counted from 0."""
    runs: list[tuple[int, int]] = []
    for at in positions:
        runs.append((runs.pop()[0], at) if runs and runs[-1][1] == at - 1 else (at, at))
    return f"scan{'s' if len(positions) > 1 else ''} {spans(runs)} (from 0)"
