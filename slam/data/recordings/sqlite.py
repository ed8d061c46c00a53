"""ROS 2 recordings in SQLite files, .db3, also without their end."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.parse import quote

import numpy as np

from slam.data.point_blocks import UnreadableError
from slam.data.recordings.container import CDR, Channel, Series, number, unpack_zstd
from slam.data.recordings.mcap import ZSTD

AT_ONCE = 1 << 14
HEAD = 100  # bytes of the file's header


class Sqlite:
    """A .db3 file. See `Container`.

    Args:
        path: The file.
        wanted: Types of the messages whose places are kept.

    Raises:
        UnreadableError: It is no recording of ROS 2 in SQLite.
    """

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.series: dict[int, Series] = {}
        self.fault = ""
        with path.open("rb") as file:
            head = file.read(HEAD)
        if head[:15] != b"SQLite format 3":
            raise UnreadableError("no SQLite file")
        size, pages = path.stat().st_size, number(head, ">I", 28)
        page = number(head, ">H", 16)
        if size < pages * (65536 if page == 1 else page):
            self.fault = f"cut off after {size} bytes: its end is missing"
        # A stopped recorder leaves its last messages in a file beside, which is ignored in the mode immutable=1.
        beside = path.with_name(path.name + "-wal")
        self._modes = (*(("mode=ro",) if beside.exists() else ()), "immutable=1")
        with self._opened() as database:
            for row in database.execute("SELECT id, name, type, serialization_format FROM topics"):
                if [type(value) for value in row] == [int, str, str, str]:  # anything else is damage
                    self.channels[row[0]] = Channel(row[1], row[2], CDR if row[3] == "cdr" else row[3])
                    self.series[row[0]] = Series(row[2] in wanted)
            try:
                self._read_places(database)
            except sqlite3.DatabaseError as error:
                self.fault = self.fault or f"damaged ({error})"

    def _read_places(self, database: sqlite3.Connection) -> None:
        """Read the index in the order of the file: the database's own index of times may be damaged."""
        rows = database.execute("SELECT topic_id, timestamp, id FROM messages NOT INDEXED ORDER BY id")
        some: list[tuple[int, int, int]] = []
        try:
            for row in rows:
                if all(type(value) is int for value in row):
                    some.append(row)
                if len(some) == AT_ONCE:
                    self._add(some)
                    some = []
        finally:
            self._add(some)

    def _add(self, rows: list[tuple[int, int, int]]) -> None:
        table = np.array(rows, np.int64).reshape(-1, 3)
        for topic in np.unique(table[:, 0]):
            found = table[table[:, 0] == topic]
            if int(topic) in self.series:
                self.series[int(topic)].add(found[:, 1], 0, found[:, 2])

    def read(self, block: int, offset: int, most: int | None = None) -> bytes:
        """See `Container`."""
        try:
            with self._opened() as database, database.blobopen("messages", "data", offset, readonly=True) as blob:
                content: bytes = blob.read(-1 if most is None else most)
                return unpack_zstd(content + blob.read())[:most] if content[:4] == ZSTD else content
        except (sqlite3.Error, ValueError) as error:
            raise UnreadableError(f"a message that cannot be read ({error})") from error

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        """Open the file, each time again: a connection must not be used by several threads at once."""
        fault: sqlite3.Error | None = None
        for mode in self._modes:
            try:
                database = sqlite3.connect(f"file:{quote(str(self.path))}?{mode}", uri=True, check_same_thread=False)
            except sqlite3.Error as error:
                fault = error
                continue
            with closing(database):
                try:
                    database.execute("PRAGMA writable_schema=ON")  # or SQLite refuses a file that is cut off
                    database.execute("SELECT 1 FROM topics LIMIT 1")
                except sqlite3.Error as error:
                    fault = error
                    continue
                yield database
                return
        raise UnreadableError(f"not a recording of ROS 2, or damaged ({fault})")
