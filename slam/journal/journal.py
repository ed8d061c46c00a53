"""The journal of a run: its session, written by a thread of its own, and the last snapshot beside it."""

from __future__ import annotations

import queue
import shutil
import sqlite3
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from slam.data.atomic import remove_temporaries
from slam.data.errors import InputError
from slam.journal.session_file import SessionFile
from slam.journal.state import Frozen, StateError, thaw
from slam.journal.state_file import read_state, write_state
from slam.journal.tables import KEYFRAME, TABLES, Row, Table

SESSION, STATE = "session.sqlite", "state.npz"
SNAPSHOT_EVERY = 10.0  # s between snapshots: the work that a run which was killed repeats
COMMIT_EVERY = 0.2  # s between commits after a keyframe, each of which waits for the disk
MAX_QUEUED = 64  # rows that wait for the disk; a keyframe takes about a megabyte
Task = tuple[Table, int, Row] | tuple[dict[str, Any], dict[str, Frozen], list[int]] | threading.Event


class Journal:
    """Appends rows to a session and writes snapshots, in the background. Any thread may use it.

    Use `begin` or `resume`. Errors of the background are raised by the next call.

    Attributes:
        path: Path of the session.
        state: The parts of the snapshot that the run continues from, None for a new run.
    """

    def __init__(self, file: SessionFile, state: Mapping[str, Any] | None) -> None:
        self.file, self.path, self.state = file, file.path, state
        self._counts = {name: file.count(table) for name, table in TABLES.items()}  # rows, also those in the queue
        self._committed_keyframes = self._counts[KEYFRAME.name]
        self._queue: queue.Queue[Task | None] = queue.Queue(MAX_QUEUED)
        self._lock = threading.Lock()
        self._fault: InputError | None = None
        self._closed = False
        self._last_snapshot = self._last_commit = time.monotonic()
        self._thread = threading.Thread(target=self._write, name="journal", daemon=True)
        self._thread.start()

    @classmethod
    def begin(cls, folder: Path, about: Mapping[str, Any]) -> Self:
        """Begin a session in a new folder.

        Args:
            folder: The folder; an earlier session in it is removed.
            about: Plain values that describe the run: `resume` compares them.

        Raises:
            InputError: The folder cannot be written.
        """
        try:
            remove_session(folder)
            folder.mkdir(parents=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from error
        return cls(SessionFile.create(folder / SESSION, about), None)

    @classmethod
    def resume(cls, folder: Path) -> Self:
        """Open the session in a folder, as it was at its last snapshot.

        Raises:
            InputError: There is none, or it is damaged or cannot be written.
        """
        remove_temporaries(folder, [STATE])
        counts, parts = read_state(folder / STATE)
        file = SessionFile.open(folder / SESSION, write=True)
        try:
            state = {name: thaw(part) for name, part in parts.items()}
            file.cut({name: int(counts[name]) for name in TABLES})
            return cls(file, state)
        except (StateError, KeyError, TypeError, ValueError) as error:
            file.close()
            raise InputError(f"{folder / STATE}: damaged ({error}); run again without --resume") from error
        except InputError:
            file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def counts(self) -> dict[str, int]:
        """Return the number of rows of each table so far."""
        with self._lock:
            return dict(self._counts)

    def append(self, table: Table, *values: Any) -> None:
        """Append a row; wait only if the disk is far behind.

        Raises:
            InputError: An earlier row or snapshot could not be written.
        """
        self.check()
        with self._lock:
            number = self._counts[table.name]
            self._counts[table.name] += 1
            self._queue.put((table, number, values))

    def snapshot_due(self) -> bool:
        """Whether it is time for a snapshot; the next one is due `SNAPSHOT_EVERY` later."""
        now = time.monotonic()
        if now - self._last_snapshot < SNAPSHOT_EVERY:
            return False
        self._last_snapshot = now
        return True

    def snapshot(self, counts: Mapping[str, int], parts: Mapping[str, Frozen], forgotten: Sequence[int] = ()) -> None:
        """Write a snapshot after all rows so far.

        Args:
            counts: Number of rows by table that belong to it.
            parts: Its parts by name.
            forgotten: Keyframes whose clouds a run that continues from it does not read; they are emptied.

        Raises:
            InputError: An earlier row or snapshot could not be written.
        """
        self.check()
        self._queue.put((dict(counts), dict(parts), list(forgotten)))

    def cloud(self, number: int) -> bytes:
        """Return the packed cloud of a keyframe from the session, once it is there.

        Raises:
            InputError: The row is damaged, or could not be written.
        """
        if number >= self._committed_keyframes:
            self.flush()
        with SessionFile.open(self.path) as reader:
            return reader.cloud(number)

    def check(self) -> None:
        """Raise the error of the background, if any.

        Raises:
            InputError: A row or snapshot could not be written.
        """
        if self._fault:
            raise self._fault
        if self._closed:
            raise RuntimeError("the journal is closed")

    def flush(self) -> None:
        """Wait until all rows so far are on the disk.

        Raises:
            InputError: They could not be written.
        """
        self.check()
        done = threading.Event()
        self._queue.put(done)
        while not done.wait(COMMIT_EVERY) and self._thread.is_alive():
            pass  # the journal may be closed meanwhile
        self.check()

    def close(self) -> None:
        """Write what is queued, and close the session: one whole file remains. Errors are not raised."""
        self._closed = True
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def move(self, folder: Path) -> None:
        """Close the session and rename its folder; an earlier session of that name is removed.

        Raises:
            InputError: Rows or snapshots could not be written, or the folder cannot be renamed.
        """
        self.close()
        if self._fault:
            raise self._fault
        try:
            remove_session(folder)
            self.path.parent.rename(folder)
        except OSError as error:
            raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from error
        self.path = folder / SESSION

    def _write(self) -> None:
        """The thread: after an error it only empties the queue, so that nobody waits for it."""
        while (task := self._next()) is not None:
            if self._fault is None:
                try:
                    self._do(task)
                except InputError as error:
                    self._fault = error
                except Exception as error:
                    fault = f"cannot be written ({error}); free space, then continue with --resume"
                    self._fault = InputError(f"{self.path}: {fault}")
            if isinstance(task, threading.Event):
                task.set()
        try:
            if self._fault is None:
                self.file.seal()
        except sqlite3.Error as error:
            self._fault = InputError(f"{self.path}: cannot be written ({error}); free space")
        self.file.close()

    def _next(self) -> Task | None:
        try:
            return self._queue.get(timeout=COMMIT_EVERY)
        except queue.Empty:
            return threading.Event()  # nothing to do: commit

    def _do(self, task: Task) -> None:
        if isinstance(task, threading.Event):
            self._commit()
        elif isinstance(task[0], Table):
            table, number, row = task
            self.file.append(table, number, row)
            if table is KEYFRAME and time.monotonic() - self._last_commit > COMMIT_EVERY:
                self._commit()
        else:
            counts, parts, forgotten = task
            self._commit()  # the rows that a snapshot counts on are on the disk before it
            write_state(self.path.with_name(STATE), counts, parts)
            for number in forgotten:  # only now: a run that continues from the snapshot before may read them
                self.file.forget_cloud(number)

    def _commit(self) -> None:
        self.file.commit()
        self._last_commit = time.monotonic()
        self._committed_keyframes = self.file.count(KEYFRAME)


def has_snapshot(folder: Path) -> bool:
    """Check whether a folder has a session that can be resumed."""
    return (folder / STATE).is_file() and (folder / SESSION).is_file()


def remove_session(folder: Path) -> None:
    """Remove the folder of a session; nothing if there is none, and only the link if it is one.

    Raises:
        OSError: It cannot be removed.
    """
    if folder.is_symlink() or folder.is_file():
        folder.unlink()
    elif folder.is_dir():
        (folder / STATE).unlink(missing_ok=True)  # first: without it nothing can be resumed
        shutil.rmtree(folder)
