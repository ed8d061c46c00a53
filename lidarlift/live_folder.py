"""The run folder of a live run: its lock and its session."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from slam.data.atomic import require_no_links, require_writable
from slam.data.errors import InputError
from slam.journal.journal import Journal
from slam.journal.lock import locked
from slam.run import Run
from slam.session import SESSION, UNFINISHED, begin_session, drop_session, recorded_frames, resume_session, save_run


class LiveFolder:
    """Keeps other runs out of a run folder, and holds its session, until it is saved or closed.

    Args:
        folder: The folder.
        about: What the results depend on, see `live_identity`.
        resume: Continue the session in the folder, if there is one.

    Attributes:
        journal: The session.

    Raises:
        InputError: Another run writes into the folder, it cannot be written, or its unfinished run would be lost.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any], resume: bool) -> None:
        require_writable(folder)
        require_no_links(folder, (SESSION, UNFINISHED))
        self._folder = folder
        with ExitStack() as stack:
            stack.enter_context(locked(folder))
            self.journal = _journal(folder, dict(about), resume)
            self._lock = stack.pop_all()

    def save(self, run: Run) -> None:
        """Write the finished run, and release the folder.

        Raises:
            InputError: The folder cannot be written.
        """
        save_run(run, self._folder, self.journal)
        self._lock.close()

    def close(self) -> None:
        """Write what is queued, and release the folder; the session stays, unless it has no frames."""
        self.journal.close()
        if not recorded_frames(self._folder):
            drop_session(self._folder)
        self._lock.close()


def _journal(folder: Path, about: dict[str, Any], resume: bool) -> Journal:
    """The session that is continued, or a new one: scans that came live cannot be had again, so none is overwritten."""
    if resume and (journal := resume_session(folder, about)):
        return journal
    if frames := recorded_frames(folder):
        remedy = "it ended before its first snapshot" if resume else "continue it with resume=True"
        raise InputError(
            f"{folder}: holds an unfinished run of {frames} scans; {remedy}, keep it by `lidarlift export`, and choose "
            f"another folder or remove {folder / UNFINISHED}"
        )
    return begin_session(folder, about)
