"""What the files of recordings share: messages on channels, found once by their places and then read one by one.

rosbags refuses files without an end, and reads from front to back. So the containers are walked here; what the messages
hold is rosbags' part.
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
LARGEST = 1 << 31  # bytes of a chunk or message; whatever says more is damaged


class Channel(NamedTuple):
    """A topic in a file.

    Attributes:
        topic: Its name.
        type: Of its messages, as ROS 2 writes it: 'sensor_msgs/msg/PointCloud2'.
        encoding: How they are written, `ROS1` or `CDR`.
    """

    topic: str
    type: str
    encoding: str


class Series:
    """The messages of a channel: how many, from when to when, and where each is if anybody wants to read them.

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
        """Messages at `times` (N,) [ns], in blocks, at offsets (N,) within them."""
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
        """(N, 3) int64: time [ns], block, offset."""
        return np.frombuffer(self._rows, np.int64).reshape(-1, 3) if len(self._rows) else np.zeros((0, 3), np.int64)


class Container(Protocol):
    """A file of a recording. It may be read from any thread.

    Attributes:
        path: Of the file.
        channels: By their numbers in the file.
        series: The messages of each.
        fault: What is wrong with it, and was gone around; '' for nothing.
    """

    path: Path
    channels: dict[int, Channel]
    series: dict[int, Series]
    fault: str

    def read(self, block: int, offset: int, most: int | None = None) -> bytes:
        """A message, or no more than its first `most` bytes. Raises UnreadableError where it is damaged."""
        ...


class Block(NamedTuple):
    """A chunk of a file: where its bytes are, how they are packed, and how many they are unpacked."""

    start: int
    size: int
    packing: str
    unpacked: int


class Chunked:
    """The part that ROS 1 bags and MCAP have in common: chunks of messages, each followed by their places in it.

    A walk goes from chunk to chunk and reads these places alone. Where they are missing, as where a file ends in the
    middle, the chunk itself is looked through.
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
        """The bytes of a chunk, as many as can be had."""
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
        """Up to `size` bytes from `offset` on in a chunk, or in the file where `block` is -1."""
        if block < 0 or self.blocks[block].packing in ("", "none"):
            return self._bytes(block, offset, size)
        return self.unpacked(block)[offset : offset + size]

    def _bytes(self, block: int, offset: int, size: int) -> bytes:
        """The same of what is in the file, whatever it says of sizes."""
        start, end = 0, self._size
        if block >= 0:
            start, length, _, _ = self.blocks[block]
            end = min(end, start + length)
        size = min(size, end - start - offset)
        if size <= 0:
            return b""
        with self.path.open("rb") as file:  # opened anew each time, for any thread may ask
            file.seek(start + offset)
            return file.read(size)


def unpack(content: bytes, packing: str, length: int) -> bytes:
    """The bytes of a chunk; of one that is cut short, those that come before. Raises UnreadableError on damage."""
    if length > LARGEST:
        raise UnreadableError(f"a chunk of {length} bytes")
    try:
        return UNPACK[packing](content, length)
    except KeyError:
        raise UnreadableError(f"chunks packed by '{packing}'; known: {', '.join(filter(None, UNPACK))}") from None
    except (OSError, RuntimeError, ValueError, EOFError) as error:
        raise UnreadableError(f"a chunk that cannot be unpacked ({error})") from error


def unpack_lz4(content: bytes, length: int) -> bytes:
    """LZ4's frame format, up to `length` bytes."""
    import lz4.frame

    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(content, length))


def unpack_zstd(content: bytes, length: int = LARGEST) -> bytes:
    """One or more Zstandard frames, up to `length` bytes each."""
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
    """The next bytes. Raises EOFError where the file ends before."""
    if size > LARGEST:
        raise UnreadableError(f"a record of {size} bytes")
    content = file.read(size)
    if len(content) < size:
        raise EOFError
    return content


def number(content: bytes, kind: str, offset: int = 0) -> int:
    """One number of a `struct` format. Raises UnreadableError where the bytes end before."""
    try:
        return int(struct.unpack_from(kind, content, offset)[0])
    except struct.error:
        raise UnreadableError("a record that is too short") from None
