"""How long a command still takes: what its steps took elsewhere, as much slower or faster as this machine is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter

LOOPS = 20_000_000
USUAL = 0.25  # seconds that so many loops took where the steps' seconds were measured


class Forecast:
    """Of steps whose usual seconds are known, those of a machine on which `timed` gives USUAL.

    At first a timing of less than a second tells how this machine compares; from the first step that is done, what
    the steps took does.
    """

    def __init__(
        self,
        seconds: Mapping[str, float],
        clock: Callable[[], float] = perf_counter,
        timed: Callable[[], float] | None = None,
    ) -> None:
        self._left, self._done = dict(seconds), 0.0
        self._slowness = (timed or timed_loops)() / USUAL
        self._clock, self._begin = clock, clock()

    def done(self, step: str) -> None:
        """The step, which was begun when the one before was done, is done."""
        self._done += self._left.pop(step)
        if self._done > 0:
            self._slowness = (self._clock() - self._begin) / self._done

    @property
    def left(self) -> bool:
        """Whether there is a step to come."""
        return bool(self._left)

    def __str__(self) -> str:
        """What is left, for people: to ten seconds below two minutes, to half a minute above."""
        seconds = self._slowness * sum(self._left.values())
        if seconds >= 115:
            return f"about {round(seconds / 30) / 2:g} minutes"
        return f"about {max(10 * round(seconds / 10), 10)} seconds"


def timed_loops() -> float:
    """Seconds of LOOPS rounds of Python; where other programs come between, they will do so later as well."""
    begin = perf_counter()
    for _ in range(LOOPS):
        pass
    return perf_counter() - begin
