"""Messages and progress bars on stderr."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from rich import console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from lidarlift.reporting import Reporter

messages = console.Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)


@contextmanager
def progress(title: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a progress bar of `total` frames with the frame rate; call the yielded function once per frame."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]} frames/s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=messages) as bar:
        task = bar.add_task(title, total=total, rate="-")

        def advance() -> None:
            speed = bar.tasks[task].speed
            bar.update(task, advance=1, rate=f"{speed:.1f}" if speed else "-")

        yield advance


def command_line() -> str:
    """Return the command line of this process as a person would type it."""
    return shlex.join(["lidarlift", *sys.argv[1:]])


class Console(Reporter):
    """Reporter of the command line: progress bars and notes on stderr."""

    def progress(self, title: str, total: int) -> AbstractContextManager[Callable[[], None]]:
        """Show a progress bar."""
        return progress(title, total)

    def note(self, message: str) -> None:
        """Print a note."""
        messages.print(f"Note: {message}", style="yellow", markup=False)
