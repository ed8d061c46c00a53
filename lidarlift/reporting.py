"""What a caller is told while work goes on: progress and notes. The command line shows them; scripts may not care."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from slam.data.problem import Problem

#: A task of so many steps with a title, as a context; its value is called once a step.
Progress = Callable[[str, int], AbstractContextManager[Callable[[], None]]]

log = logging.getLogger("lidarlift")


class Reporter(Protocol):
    """Where progress and notes go."""

    def progress(self, title: str, total: int) -> AbstractContextManager[Callable[[], None]]:
        """A task of `total` steps; what it yields is called once a step."""
        ...

    def note(self, message: str) -> None:
        """One line that does not stop the work."""
        ...


class Quiet:
    """Shows no progress and logs notes: the reporter of scripts."""

    def progress(self, title: str, total: int) -> AbstractContextManager[Callable[[], None]]:
        return nullcontext(lambda: None)

    def note(self, message: str) -> None:
        log.warning(message)


def note_problems(problems: Sequence[Problem], reporter: Reporter, elsewhere: str = ", see run.json") -> None:
    """Note the first problem of each kind, how many there are, and where all are to be found."""
    kinds: dict[str, list[str]] = {}
    for problem in problems:
        kinds.setdefault(problem.kind, []).append(problem.message)
    for kind, found in kinds.items():
        more = f" (and {len(found) - 1} more{elsewhere})" if len(found) > 1 else ""
        reporter.note(f"{kind}: {found[0]}{more}")
