"""Progress and notes during long work: shown by the command line, optional for scripts."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from slam.data.problem import Problem

#: Opens a task with a title and a number of steps, as a context manager; call its value once per step.
Progress = Callable[[str, int], AbstractContextManager[Callable[[], None]]]

COMPILING = "compiling kernels, only at the first run: about 10 s ..."

log = logging.getLogger("lidarlift")


class Reporter(Protocol):
    """Receives progress and notes."""

    def progress(self, title: str, total: int) -> AbstractContextManager[Callable[[], None]]:
        """Open a task of `total` steps; call the yielded function once per step."""
        ...

    def note(self, message: str) -> None:
        """Take a message of one line that does not stop the work."""
        ...


class Quiet:
    """Reporter of scripts: shows no progress and logs notes."""

    def progress(self, title: str, total: int) -> AbstractContextManager[Callable[[], None]]:
        """Show nothing."""
        return nullcontext(lambda: None)

    def note(self, message: str) -> None:
        """Log a warning."""
        log.warning(message)


def note_problems(problems: Sequence[Problem], reporter: Reporter, elsewhere: str = ", see run.json") -> None:
    """Report the first problem of each kind, their number, and where all of them are listed."""
    kinds: dict[str, list[str]] = {}
    for problem in problems:
        kinds.setdefault(problem.kind, []).append(problem.message)
    for kind, found in kinds.items():
        more = f" (and {len(found) - 1} more{elsewhere})" if len(found) > 1 else ""
        reporter.note(f"{kind}: {found[0]}{more}")
