"""Remaining time of a command: times measured on a reference machine, scaled by the speed of this machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter

LOOPS = 20_000_000
REFERENCE = 0.25  # seconds for LOOPS loops on the reference machine, where the seconds of the steps were measured


class Forecast:
    """Forecast of the remaining time of steps, from their seconds on the reference machine.

    The scale of this machine is first measured by `timed`, in less than a second, and after the first finished step by
    the duration of the steps themselves.

    Args:
        seconds: Seconds of each step on the reference machine, where `timed` returns REFERENCE.
        clock: Current time [s].
        timed: Benchmark of this machine [s]; by default `timed_loops`.
    """

    def __init__(
        self,
        seconds: Mapping[str, float],
        clock: Callable[[], float] = perf_counter,
        timed: Callable[[], float] | None = None,
    ) -> None:
        self._left, self._done = dict(seconds), 0.0
        self._slowness = (timed or timed_loops)() / REFERENCE
        self._clock, self._begin = clock, clock()

    def done(self, step: str) -> None:
        """Mark a step as finished; it began when the step before was finished."""
        self._done += self._left.pop(step)
        if self._done > 0:
            self._slowness = (self._clock() - self._begin) / self._done

    @property
    def left(self) -> bool:
        """Whether any step is unfinished."""
        return bool(self._left)

    def __str__(self) -> str:
        """Remaining time, rounded to ten seconds below two minutes and to half a minute above."""
        seconds = self._slowness * sum(self._left.values())
        if seconds >= 115:
            return f"about {round(seconds / 30) / 2:g} minutes"
        return f"about {max(10 * round(seconds / 10), 10)} seconds"


def timed_loops() -> float:
    """Return the seconds of LOOPS loops of Python; load by other programs counts, since it will slow the steps too."""
    begin = perf_counter()
    for _ in range(LOOPS):
        pass
    return perf_counter() - begin
