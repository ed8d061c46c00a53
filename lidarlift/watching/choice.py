"""The views of a run that a user asks for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidarlift.reporting import Reporter

if TYPE_CHECKING:
    from slam.run import Observer


@dataclass(frozen=True)
class Views:
    """Views of a run, in which it can be watched.

    Attributes:
        live: Show the run in the viewer rerun.
        record: Write a .rrd file for it, None for none.
        serve: PORT or HOST:PORT of a page with the progress, None for none.
    """

    live: bool = False
    record: Path | None = None
    serve: str | None = None


@contextmanager
def watched(views: Views, title: str, total: int, reporter: Reporter) -> Iterator[Observer | None]:
    """Open the views of a run, and close them at the end.

    Args:
        views: The views that are asked for.
        title: Name of the run.
        total: Number of frames of the run.
        reporter: Receives the address of the page, and a note if a view fails.

    Yields:
        The observer of the run; None without views.

    Raises:
        InputError: A view cannot be opened.
    """
    from lidarlift.watching.background import Background, Observers
    from lidarlift.watching.progress import Progress
    from lidarlift.watching.rerun_log import RerunLog
    from lidarlift.watching.server import ProgressServer, address_of

    observers: list[Observer] = []
    with ExitStack() as stack:
        if views.live or views.record is not None:
            log = RerunLog(title, show=views.live, file=views.record)
            observers.append(stack.enter_context(Background(log, reporter.note)))
        if views.serve is not None:
            progress = Progress(title, total)
            server = stack.enter_context(ProgressServer(progress.state, *address_of(views.serve)))
            reporter.note(f"progress of the run: {server.url}")
            observers.append(progress)
        yield Observers(observers) if observers else None
