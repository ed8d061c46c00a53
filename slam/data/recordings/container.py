"""Files of recordings as an index of messages, which are then read one by one; common parts of the formats.

rosbags refuses files without an end and reads from front to back. Therefore the containers are read here, and the
content of the messages by rosbags.
"""

from __future__ import annotations

import bz2
import struct
import threading
from array import array
from collections import OrderedDict
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import UnreadableError

ROS1, CDR = "ros1", "cdr"
CACHED = 3  # chunks that are kept unpacked: a scan and its image often share one
LARGEST = 1 << 31  # bytes of a chunk or message; a larger size is damage


class Channel(NamedTuple):
    """A topic in a file.

    Attributes:
        topic: Name of the topic.
        type: Type of its messages, as ROS 2 writes it: 'sensor_msgs/msg/PointCloud2'.
        encoding: Encoding of its messages, `ROS1` or `CDR`.
    """

    topic: str
    type: str
    encoding: str


class Series:
    """Index of the messages of a channel.

    Args:
        kept: Whether the places of the messages are kept.

    Attributes:
        count: Number of messages.
        first: When the first was recorded [ns].
        last: When the last was recorded [ns].
        longest: Longest step between successive ones [ns].
    """

    def __init__(self, kept: bool) -> None:
        self.kept, self.count, self.first, self.last, self.longest = kept, 0, 2**63 - 1, -(2**63), 0
        self._rows = array("q")

    def add(self, times: Array, blocks: int | Array, offsets: Array) -> None:
        """Add messages.

        Args:
            times: (N,) int64, when they were recorded [ns].
            blocks: Block of all, or of each (N,).
            offsets: (N,) int64, offset of each in its block.
        """
        if len(times) == 0:
            return
        steps = np.diff(times, prepend=self.last if self.count else times[0])
        self.longest = max(self.longest, int(steps.max()))
        self.count += len(times)
        self.first, self.last = min(self.first, int(times.min())), max(self.last, int(times.max()))
        if self.kept:
            rows = np.empty((len(times), 3), np.int64)
            rows[:, 0], rows[:, 1], rows[:, 2] = times, blocks, offsets
            self._rows.frombytes(rows.tobytes())

    @property
    def rows(self) -> Array:
        """The kept messages, (N, 3) int64: time [ns], block, offset."""
        return np.frombuffer(self._rows, np.int64).reshape(-1, 3) if len(self._rows) else np.zeros((0, 3), np.int64)


class Container(Protocol):
    """A file of a recording. It may be read from any thread.

    Attributes:
        path: The file.
        channels: The channels by their numbers in the file.
        series: The messages of each channel.
        fault: Damage despite which the file is read; '' for none.
    """

    path: Path
    channels: dict[int, Channel]
    series: dict[int, Series]
    fault: str

    def read(self, block: int, offset: int, most: int | None = None) -> bytes:
        """Read a message, or at most its first `most` bytes.

        Raises:
            UnreadableError: The message is damaged.
        """
        ...


class Block(NamedTuple):
    """A chunk of a file.

    Attributes:
        start: Place of its bytes in the file.
        size: Number of bytes in the file.
        packing: Compression; '' or 'none' for none.
        unpacked: Number of bytes after decompression.
    """

    start: int
    size: int
    packing: str
    unpacked: int


class Chunked:
    """Common part of ROS 1 bags and MCAP: chunks of messages, each followed by the index of its messages.

    Only the indexes are read at first. If an index is missing, as where a file was cut off, the chunk itself is read.

    Args:
        path: The file.
        wanted: Types of the messages whose places are kept.
    """

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        self.path, self._wanted, self._size = path, wanted, path.stat().st_size
        self.channels: dict[int, Channel] = {}
        self.series: dict[int, Series] = {}
        self.fault = ""
        self.blocks: list[Block] = []
        self._unpacked: OrderedDict[int, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def _series(self, number: int) -> Series:
        found = self.series.get(number)
        if found is None:
            found = self.series[number] = Series(self.channels[number].type in self._wanted)
        return found

    def unpacked(self, block: int) -> bytes:
        """Return the bytes of a chunk; of one that is cut short, those that are there.

        Raises:
            UnreadableError: The chunk is damaged.
        """
        with self._lock:
            if block in self._unpacked:
                self._unpacked.move_to_end(block)
                return self._unpacked[block]
        _, size, packing, length = self.blocks[block]
        content = unpack(self._bytes(block, 0, size), packing, length)
        with self._lock:
            self._unpacked[block] = content
            while len(self._unpacked) > CACHED:
                self._unpacked.popitem(last=False)
        return content

    def window(self, block: int, offset: int, size: int) -> bytes:
        """Return up to `size` bytes from `offset` on in a chunk; in the file if `block` is -1.

        Raises:
            UnreadableError: The chunk is damaged.
        """
        if block < 0 or self.blocks[block].packing in ("", "none"):
            return self._bytes(block, offset, size)
        return self.unpacked(block)[offset : offset + size]

    def _bytes(self, block: int, offset: int, size: int) -> bytes:
        """The same without decompression; never beyond the end of the chunk or the file."""
        start, end = 0, self._size
        if block >= 0:
            start, length, _, _ = self.blocks[block]
            end = min(end, start + length)
        size = min(size, end - start - offset)
        if size <= 0:
            return b""
        with self.path.open("rb") as file:  # opened each time, for any thread may read
            file.seek(start + offset)
            return file.read(size)


def unpack(content: bytes, packing: str, length: int) -> bytes:
    """Decompress a chunk; of one that is cut short, the part that is there.

    Raises:
        UnreadableError: The chunk is damaged, or its compression is unknown.
    """
    if length > LARGEST:
        raise UnreadableError(f"a chunk of {length} bytes")
    try:
        return UNPACK[packing](content, length)
    except KeyError:
        raise UnreadableError(f"chunks packed by '{packing}'; known: {', '.join(filter(None, UNPACK))}") from None
    except (OSError, RuntimeError, ValueError, EOFError) as error:
        raise UnreadableError(f"a chunk that cannot be unpacked ({error})") from error


def unpack_lz4(content: bytes, length: int) -> bytes:
    """Decompress LZ4's frame format, up to `length` bytes."""
    import lz4.frame

    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(content, length))


def unpack_zstd(content: bytes, length: int = LARGEST) -> bytes:
    """Decompress one or more Zstandard frames, up to `length` bytes each.

    Raises:
        ValueError: They are damaged.
    """
    module = _zstd()
    result = b""
    try:
        while content:
            decompressor = module.ZstdDecompressor()
            result += decompressor.decompress(content, length)
            content = decompressor.unused_data if decompressor.eof else b""
    except module.ZstdError as error:
        raise ValueError(str(error)) from error
    return result


def _zstd() -> Any:
    """Python's from 3.14 on, before that its backport, which rosbags brings along."""
    try:
        from compression import zstd  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        from backports import zstd  # type: ignore[no-redef,unused-ignore]
    return zstd


UNPACK: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda content, _: content,
    "none": lambda content, _: content,
    "bz2": lambda content, length: bz2.BZ2Decompressor().decompress(content, length),
    "lz4": unpack_lz4,
    "zstd": unpack_zstd,
}


def exactly(file: BinaryIO, size: int) -> bytes:
    """Read the next `size` bytes.

    Raises:
        EOFError: The file ends before.
        UnreadableError: The size is that of a damaged record.
    """
    if size > LARGEST:
        raise UnreadableError(f"a record of {size} bytes")
    content = file.read(size)
    if len(content) < size:
        raise EOFError
    return content


def number(content: bytes, kind: str, offset: int = 0) -> int:
    """Read one number of a `struct` format.

    Raises:
        UnreadableError: The bytes end before.
    """
    try:
        return int(struct.unpack_from(kind, content, offset)[0])
    except struct.error:
        raise UnreadableError("a record that is too short") from None
