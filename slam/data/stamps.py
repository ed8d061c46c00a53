"""Stamps that make no sense beside those before them: mended where a whole drive's are known, else told."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.problem import Problem, spans

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


def usual_step(stamps: Array) -> float | None:
    """Seconds from scan to scan, usually: the median of the steps forward between stamps (N,). None without any."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else None


def mended(stamps: Array, where: object) -> tuple[Array, tuple[Problem, ...]]:
    """Stamps (N,) [s] that rise, and a Problem that says which did not.

    A stamp that is missing (NaN), repeats the one before or lies apart from those before and after, goes between these.
    Where a clock was set back, all that follows is shifted so that one usual step lies between. Where it was set ahead,
    or scans are missing, the stamps stay: nobody knows which it was.

    Args:
        stamps: (N,) [s], of which at least two differ.
        where: What to name in the message.
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
        lead = place - 2  # is the one before too late, or this one too early?
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
    result[wrong] = _between(np.array(known), result[known], np.array(wrong, np.int64), step)
    return result, (Problem("mended stamps", _told(where, sorted(wrong), set_back)),)


def _between(known: Array, stamps: Array, wrong: Array, step: float) -> Array:
    """At the positions `wrong`, between the stamps at positions `known`; a step apart beyond the first and the last."""
    inside = np.interp(wrong, known, stamps)
    return inside + step * (np.minimum(wrong - known[0], 0) + np.maximum(wrong - known[-1], 0))


def _told(where: object, wrong: list[int], set_back: list[int]) -> str:
    parts = []
    if wrong:
        parts.append(f"stamps missing, repeated or apart from the others at {_places(wrong)}: put between these")
    if set_back:
        parts.append(f"the clock was set back at {_places(set_back)}: the rest follows one usual step later")
    return f"{where}: {'; '.join(parts)}"


def _places(positions: list[int]) -> str:
    """Of scans, counted from 0, for reading."""
    runs: list[tuple[int, int]] = []
    for at in positions:
        runs.append((runs.pop()[0], at) if runs and runs[-1][1] == at - 1 else (at, at))
    return f"scan{'s' if len(positions) > 1 else ''} {spans(runs)} (from 0)"
