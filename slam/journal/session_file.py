"""The session of a run: an SQLite database to which rows are appended; docs/session.md describes it."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote

from slam.data.errors import InputError
from slam.journal.tables import KEYFRAME, TABLES, Row, RowError, Table

FORMAT = 1
APPLICATION = 0x4C4C5353  # in the file's header, 'LLSS': lidarlift's SLAM session
ABOUT = "CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT)"
SCHEMA = {"about": ABOUT, **{name: table.schema for name, table in TABLES.items()}}
PAGE = 1 << 14  # bytes of a page: with larger ones than SQLite's 4096, clouds are written in half of the time
MAX_VALUE = 1 << 28  # bytes of a value; the cloud of a keyframe takes about one million
REMEDY = "choose another session, or run again without --resume"


class SessionFile:
    """An open session. Not thread-safe, but any one thread may use it.

    Use `create` or `open`.
    """

    def __init__(self, path: Path, database: sqlite3.Connection) -> None:
        self.path, self._database = path, database

    @classmethod
    def create(cls, path: Path, about: Mapping[str, Any]) -> Self:
        """Create a session; `about` are plain values that describe the run.

        Raises:
            InputError: The file exists, or cannot be written.
        """
        try:
            path.open("xb").close()  # not through a link, and nobody else's file
            file = cls(path, _connected(path, "rw"))
            execute = file._database.execute
            execute(f"PRAGMA page_size = {PAGE}")
            execute(f"PRAGMA application_id = {APPLICATION}")
            execute(f"PRAGMA user_version = {FORMAT}")
            file._prepare_writing()
            file._begin()
            for statement in SCHEMA.values():
                execute(statement)
            for name, value in about.items():
                execute("INSERT INTO about VALUES (?, ?)", (name, json.dumps(value)))
            file.commit()
        except (sqlite3.Error, OSError) as error:
            raise InputError(f"{path}: cannot be written ({error}); free space or choose another folder") from error
        return file

    @classmethod
    def open(cls, path: Path, write: bool = False) -> Self:
        """Open a session, also one of a run that was killed.

        Raises:
            InputError: The file is missing, damaged, no session, or of another format.
        """
        if path.is_symlink() or not path.is_file():
            raise InputError(f"{path}: no session; give a folder written by `lidarlift run`")
        try:
            database = _connected(path, "rw")  # a reader of a killed run completes its last transaction
        except sqlite3.Error as error:
            raise InputError(f"{path}: cannot be read ({error}); {REMEDY}") from error
        file = cls(path, database)
        try:
            file._check()
            if write:
                file._prepare_writing()
            else:
                database.execute("PRAGMA query_only = ON")
        except sqlite3.Error as error:
            file.close()
            raise InputError(f"{path}: damaged, or no session ({error}); {REMEDY}") from error
        except InputError:
            file.close()
            raise
        return file

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; rows since the last commit are lost."""
        self._database.close()

    def seal(self) -> None:
        """Commit, and merge SQLite's second file into the first, so that a copy of one file is whole."""
        self.commit()
        self._database.execute("PRAGMA journal_mode = DELETE")

    @property
    def about(self) -> dict[str, Any]:
        """The values that describe the run.

        Raises:
            InputError: They are damaged.
        """
        try:
            return {str(name): json.loads(value) for name, value in self._database.execute("SELECT * FROM about")}
        except (sqlite3.Error, ValueError, TypeError, RecursionError) as error:
            raise InputError(f"{self.path}: damaged ({error}); {REMEDY}") from error

    def append(self, table: Table, number: int, row: Row) -> None:
        """Append a row.

        Raises:
            sqlite3.Error: The file cannot be written.
        """
        self._begin()
        self._database.execute(table.insertion, table.sealed(number, row))

    def commit(self) -> None:
        """Put all rows so far on the disk for certain.

        Raises:
            sqlite3.Error: The file cannot be written.
        """
        if self._database.in_transaction:
            self._database.execute("COMMIT")

    def cut(self, counts: Mapping[str, int]) -> None:
        """Remove the rows beyond these numbers of rows by table: the run continues from there.

        Raises:
            InputError: A table has fewer rows, or the file cannot be written.
        """
        try:
            self._begin()
            for name, count in counts.items():
                if self.count(TABLES[name]) < count:
                    raise InputError(f"{self.path}: damaged (rows of table {name} are missing); {REMEDY}")
                self._database.execute(f"DELETE FROM {name} WHERE number >= ?", (count,))
            self.commit()
        except sqlite3.Error as error:
            raise InputError(f"{self.path}: cannot be written ({error}); free space") from error

    def count(self, table: Table) -> int:
        """Return the number of rows of a table: one more than the last row's number.

        Raises:
            InputError: The file is damaged.
        """
        return int(self._one(f"SELECT coalesce(max(number), -1) + 1 FROM {table.name}", ()))

    def rows(self, table: Table) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a table in order, checked.

        Raises:
            InputError: A row is damaged.
        """
        number = 0
        try:
            for stored in self._database.execute(f"SELECT * FROM {table.name} ORDER BY number"):
                yield table.opened(number, stored)
                number += 1
        except (sqlite3.Error, RowError) as error:
            raise InputError(f"{self.path}: damaged ({error}); {REMEDY}") from error

    def keyframes(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of the keyframes without their clouds, whose checksums are checked by `cloud` alone."""
        names = ", ".join(name for name, kind in KEYFRAME.columns if kind != "BLOB")
        try:
            found = self._database.execute(f"SELECT number, {names} FROM keyframe ORDER BY number")
            for at, stored in enumerate(found):
                if stored[0] != at or [type(value) for value in stored] != [int, int, float, str]:
                    raise RowError(f"table keyframe: row {at} is missing or damaged")
                yield stored[1:]
        except (sqlite3.Error, RowError) as error:
            raise InputError(f"{self.path}: damaged ({error}); {REMEDY}") from error

    def cloud(self, number: int) -> bytes:
        """Return the packed cloud of a keyframe.

        Raises:
            InputError: The row is damaged.
        """
        return bytes(self._keyframe(number)[-1])

    def _keyframe(self, number: int) -> tuple[Any, ...]:
        """The values of the row of a keyframe, checked."""
        try:
            stored = self._database.execute("SELECT * FROM keyframe WHERE number = ?", (number,)).fetchone()
            if stored is None:
                raise RowError(f"table keyframe: row {number} is missing")
            return KEYFRAME.opened(number, stored)
        except (sqlite3.Error, RowError) as error:
            raise InputError(f"{self.path}: damaged ({error}); {REMEDY}") from error

    def forget_cloud(self, number: int) -> None:
        """Empty the cloud of a keyframe; later rows take its place in the file.

        Raises:
            InputError: The row is damaged.
            sqlite3.Error: The file cannot be written.
        """
        *values, cloud = self._keyframe(number)
        if cloud:
            self._begin()
            *_, crc = KEYFRAME.sealed(number, (*values, b""))
            self._database.execute("UPDATE keyframe SET cloud = ?, crc = ? WHERE number = ?", (b"", crc, number))

    def _begin(self) -> None:
        if not self._database.in_transaction:
            self._database.execute("BEGIN IMMEDIATE")

    def _prepare_writing(self) -> None:
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = FULL")  # each commit is on the disk when it returns

    def _check(self) -> None:
        """Raise InputError unless this is a session of this format, with its tables and nothing else."""
        execute = self._database.execute
        if self._one("PRAGMA application_id", ()) != APPLICATION:
            raise InputError(f"{self.path}: no session of lidarlift; give a folder written by `lidarlift run`")
        version = self._one("PRAGMA user_version", ())
        if version != FORMAT:
            raise InputError(f"{self.path}: a session of format {version}, and this version reads {FORMAT}; {REMEDY}")
        found = execute("SELECT name, sql FROM sqlite_schema WHERE name NOT LIKE 'sqlite_autoindex%'").fetchall()
        if dict(found) != SCHEMA:
            raise InputError(f"{self.path}: damaged (other tables than a session has); {REMEDY}")

    def _one(self, query: str, values: Row) -> Any:
        try:
            return self._database.execute(query, values).fetchone()[0]
        except sqlite3.Error as error:
            raise InputError(f"{self.path}: damaged, or no session ({error}); {REMEDY}") from error


def _connected(path: Path, mode: str) -> sqlite3.Connection:
    """A connection that trusts nothing in the file: no functions in its schema, and no value of any size."""
    address = f"file:{quote(str(path.absolute()))}?mode={mode}"
    database = sqlite3.connect(address, uri=True, isolation_level=None, check_same_thread=False)
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE)
    database.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    database.execute("PRAGMA trusted_schema = OFF")
    database.execute("PRAGMA cell_size_check = ON")
    return database
