"""MCAP files (mcap.dev/spec), also without their end, chunks, indexes or summary."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import UnreadableError
from slam.data.recordings.container import CDR, ROS1, Block, Channel, Chunked, exactly, number, unpack_zstd

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x0F
PLACE = np.dtype([("time", "<u8"), ("offset", "<u8")])
HEAD = 9 + 22  # bytes of a record's head, and of a message before its data
ZSTD = b"\x28\xb5\x2f\xfd"  # of messages that rosbag2 has compressed one by one


class Mcap(Chunked):
    """An .mcap file with messages of ROS 2 or ROS 1. See `Container`.

    Args:
        path: The file.
        wanted: Types of the messages whose places are kept.

    Raises:
        UnreadableError: It is no MCAP file.
    """

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        super().__init__(path, wanted)
        self._schemas: dict[int, str] = {0: ""}
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise UnreadableError("no MCAP file")
            size = path.stat().st_size
            self._read_summary(file, size)
            self._walk(file, size)

    def read(self, block: int, offset: int, most: int | None = None) -> bytes:
        """See `Container`."""
        head = self.window(block, offset, HEAD)
        if len(head) < HEAD or head[0] != MESSAGE:
            raise UnreadableError("something else than a message at its place")
        size = number(head, "<Q", 1) - 22
        content = self.window(block, offset + HEAD, size if most is None else min(size, most))
        if content[:4] == ZSTD:
            return unpack_zstd(self.window(block, offset + HEAD, size))[:most]
        if len(content) < size and (most is None or len(content) < most):
            raise UnreadableError("a message that is cut short")
        return content

    def _read_summary(self, file: BinaryIO, size: int) -> None:
        """Read the schemas and channels, which a complete file repeats at its end."""
        end = 9 + 20 + len(MAGIC)
        file.seek(max(size - end, 0))
        footer = file.read(end)
        if footer[:1] == bytes([FOOTER]) and footer.endswith(MAGIC):
            start = number(footer, "<Q", 9)
            if 0 < start < size:
                file.seek(start)
                try:
                    for _, op, content in _records(file):
                        self._note(op, content)
                except UnreadableError as error:
                    self.fault = f"a damaged summary ({error})"
        else:
            self.fault = f"cut off after {size} bytes: its end is missing"
        file.seek(len(MAGIC))

    def _note(self, op: int, content: bytes) -> None:
        if op == SCHEMA:
            self._schemas[number(content, "<H")] = _text(content, 2)[0]
        elif op == CHANNEL and number(content, "<H") not in self.channels:
            topic, at = _text(content, 4)
            encoding, _ = _text(content, at)
            kind = self._schemas.get(number(content, "<H", 2), "")
            package, _, name = kind.replace("/msg/", "/").partition("/")
            form = {"cdr": CDR, "ros1": ROS1}.get(encoding, encoding)
            self.channels[number(content, "<H")] = Channel(topic, f"{package}/msg/{name}" if name else kind, form)

    def _walk(self, file: BinaryIO, size: int) -> None:
        places: list[tuple[int, Array]] = []
        whole = True
        while (at := file.tell()) < size:
            try:
                head = exactly(file, 9)
                length = number(head, "<Q", 1)
                if head[0] == DATA_END or head[0] == FOOTER:
                    break
                if head[0] == CHUNK:
                    self._finish(places)
                    places = []
                    self._chunk(file, length, size)
                elif head[0] == INDEX:
                    content = exactly(file, length)
                    places.append((number(content, "<H"), np.frombuffer(content[6:], PLACE)))
                elif head[0] == MESSAGE:
                    self._bare_message(file, at, length, size)
                else:
                    content = exactly(file, length) if head[0] in (SCHEMA, CHANNEL) else b""
                    self._note(head[0], content)
                    file.seek(at + 9 + length)
            except (EOFError, UnreadableError, ValueError) as error:
                self.fault = f"damaged or cut off at byte {at} of {size}{f' ({error})' if str(error) else ''}"
                whole = isinstance(error, UnreadableError | ValueError)
                break
        else:
            whole = False
        self._finish(places if whole else [])

    def _chunk(self, file: BinaryIO, length: int, size: int) -> None:
        start = file.tell()
        about = exactly(file, 32)
        packing = exactly(file, number(about, "<I", 28)).decode("latin-1")
        packed = number(exactly(file, 8), "<Q")
        self.blocks.append(Block(file.tell(), packed, packing, number(about, "<Q", 16)))
        file.seek(start + length)
        if start + length > size:
            raise EOFError

    def _bare_message(self, file: BinaryIO, at: int, length: int, size: int) -> None:
        """Add a message that is in no chunk."""
        channel, _, time, _ = struct.unpack("<HIQQ", exactly(file, 22))
        if at + 9 + length > size:
            raise EOFError
        if channel in self.channels:
            self._series(channel).add(np.array([time], np.int64), -1, np.array([at]))
        file.seek(at + 9 + length)

    def _finish(self, places: list[tuple[int, Array]]) -> None:
        """Add the messages of the last chunk, by the index that follows it, else from the chunk itself."""
        if not self.blocks:
            return
        last = len(self.blocks) - 1
        if not places or any(channel not in self.channels for channel, _ in places):
            try:
                places = self._look_through(self.unpacked(last))
            except (UnreadableError, struct.error) as error:
                self.fault = f"a damaged chunk ({error}); what is in it is left out"
                return
        for channel, found in places:
            if channel in self.channels:
                self._series(channel).add(found["time"].astype(np.int64), last, found["offset"].astype(np.int64))

    def _look_through(self, content: bytes) -> list[tuple[int, Array]]:
        """Index the whole messages in a chunk, and note the schemas and channels in it."""
        places: dict[int, list[tuple[int, int]]] = {}
        for at, op, record in _records(BytesIO(content)):
            self._note(op, record)
            if op == MESSAGE:
                channel, _, time, _ = struct.unpack_from("<HIQQ", record)
                places.setdefault(channel, []).append((time, at))
        return [(channel, np.array(rows, PLACE)) for channel, rows in places.items()]


def _records(file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
    """Iterate over place, kind and content of the records up to the end of the file or of its summary."""
    while True:
        at = file.tell()
        try:
            head = exactly(file, 9)
            if head[0] == FOOTER:
                return
            yield at, head[0], exactly(file, number(head, "<Q", 1))
        except (EOFError, UnreadableError):
            return


def _text(content: bytes, at: int) -> tuple[str, int]:
    """Read a string that follows its length, and return the place after it."""
    end = at + 4 + number(content, "<I", at)
    return content[at + 4 : end].decode("utf-8", "replace"), end
