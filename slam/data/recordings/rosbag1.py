"""ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0), also without their end."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import UnreadableError
from slam.data.recordings.container import ROS1, Block, Channel, Chunked, exactly, number

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 4, 5, 6, 7
PLACE = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
HEAD = 512  # bytes that hold the header of a message's record, and more
Header = dict[str, bytes]


class Rosbag1(Chunked):
    """A .bag file. See `Container`.

    Args:
        path: The file.
        wanted: Types of the messages whose places are kept.

    Raises:
        UnreadableError: It is no ROS 1 bag.
    """

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        super().__init__(path, wanted)
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise UnreadableError("no ROS 1 bag of format 2.0")
            self._walk(file, path.stat().st_size)

    def read(self, block: int, offset: int, most: int | None = None) -> bytes:
        """See `Container`."""
        head = self.window(block, offset, HEAD)
        header, start, size = _record(head)
        while _op(header) == CONNECTION:  # some writers give the place of the connection before the message
            offset += start + size
            head = self.window(block, offset, HEAD)
            header, start, size = _record(head)
        if _op(header) != MESSAGE:
            raise UnreadableError("something else than a message at its place")
        wanted = size if most is None else min(most, size)
        content = head[start : start + wanted]
        if len(content) < wanted:
            content = self.window(block, offset + start, wanted)
        if len(content) < wanted:
            raise UnreadableError("a message that is cut short")
        return content

    def _walk(self, file: BinaryIO, size: int) -> None:
        self._read_connections(file, size)
        places: list[tuple[int, Array]] = []
        whole = True
        while (at := file.tell()) < size:
            try:
                header, length = _header(file)
                op = _op(header)
                if op in (CHUNK_INFO, CONNECTION):
                    break  # the end of the bag
                if op == INDEX:
                    found = np.frombuffer(exactly(file, length), PLACE)
                    places.append((number(header["conn"], "<I"), found))
                    continue
                if op == CHUNK:
                    self._finish(places)
                    places = []
                    packing = header["compression"].decode("latin-1")
                    self.blocks.append(Block(file.tell(), length, packing, number(header["size"], "<I")))
                file.seek(length, 1)
            except (EOFError, UnreadableError, KeyError, ValueError) as error:
                self.fault = f"damaged or cut off at byte {at} of {size}{f' ({error})' if str(error) else ''}"
                whole = isinstance(error, UnreadableError | KeyError | ValueError)
                break
        else:
            self.fault = self.fault or f"cut off after {size} bytes: its end is missing"
            whole = False
        self._finish(places if whole else [])

    def _read_connections(self, file: BinaryIO, size: int) -> None:
        """Read the connections at the end of the bag, whose place is in the first record."""
        try:
            header, length = _header(file)
            index = number(header["index_pos"], "<Q")
            first = file.tell() + length
            if 0 < index < size:
                file.seek(index)
                for _ in range(number(header["conn_count"], "<I")):
                    self._connection(*_with_data(file))
            file.seek(first)
        except (EOFError, UnreadableError, KeyError, ValueError):
            file.seek(len(MAGIC))

    def _connection(self, header: Header, data: bytes) -> None:
        about = _fields(data)
        package, _, name = about["type"].decode("utf-8", "replace").partition("/")
        topic = header["topic"].decode("utf-8", "replace")
        self.channels[number(header["conn"], "<I")] = Channel(topic, f"{package}/msg/{name}", ROS1)

    def _finish(self, places: list[tuple[int, Array]]) -> None:
        """Add the messages of the last chunk, by the index that follows it, else from the chunk itself."""
        if not self.blocks:
            return
        last = len(self.blocks) - 1
        if not places or any(connection not in self.channels for connection, _ in places):
            try:
                places = self._look_through(self.unpacked(last))
            except (UnreadableError, KeyError, struct.error) as error:
                self.fault = f"a damaged chunk ({error}); what is in it is left out"
                return
        for connection, found in places:
            if connection in self.channels:
                times = found["seconds"].astype(np.int64) * 10**9 + found["nanoseconds"]
                self._series(connection).add(times, last, found["offset"].astype(np.int64))

    def _look_through(self, content: bytes) -> list[tuple[int, Array]]:
        """Index the whole messages in a chunk, and note the connections in it."""
        places: dict[int, list[tuple[int, int, int]]] = {}
        file = BytesIO(content)
        for at, header, data in _records(file):
            if _op(header) == CONNECTION:
                self._connection(header, data)
            elif _op(header) == MESSAGE:
                seconds, nanoseconds = struct.unpack("<II", header["time"])
                places.setdefault(number(header["conn"], "<I"), []).append((seconds, nanoseconds, at))
        return [(connection, np.array(rows, PLACE)) for connection, rows in places.items()]


def _records(file: BinaryIO) -> Iterator[tuple[int, Header, bytes]]:
    while True:
        at = file.tell()
        try:
            yield at, *_with_data(file)
        except (EOFError, UnreadableError, KeyError, ValueError):
            return


def _with_data(file: BinaryIO) -> tuple[Header, bytes]:
    header, length = _header(file)
    return header, exactly(file, length)


def _header(file: BinaryIO) -> tuple[Header, int]:
    """Read the header of the next record, and the number of bytes of data that follow."""
    header = _fields(exactly(file, number(exactly(file, 4), "<I")))
    return header, number(exactly(file, 4), "<I")


def _record(content: bytes) -> tuple[Header, int, int]:
    """Read the header of the record that bytes begin with, the place of its data and their number."""
    length = number(content, "<I")
    if length > len(content) - 8:
        file = BytesIO(content)
        try:
            _header(file)
        except EOFError:
            raise UnreadableError("a message that is cut short") from None
    return _fields(content[4 : 4 + length]), 8 + length, number(content, "<I", 4 + length)


def _fields(content: bytes) -> Header:
    fields, at = {}, 0
    while at + 4 <= len(content):
        size = number(content, "<I", at)
        name, equals, value = content[at + 4 : at + 4 + size].partition(b"=")
        if not equals:
            raise UnreadableError("a record's header that makes no sense")
        fields[name.decode("latin-1")] = value
        at += 4 + size
    return fields


def _op(header: Header) -> int:
    return header.get("op", b"\0")[0]
