"""PCL's .pcd files: a header of text, then points as text, as they lie in memory, or compressed column by column."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import BinaryIO

import lzf
import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import AT_ONCE, Block, Columns, Content, UnreadableError, header_lines, whole_number

#: LZF makes at most 264 bytes of 3.
LZF_RATIO = 88


@dataclass(frozen=True)
class Header:
    """What a .pcd file says of itself.

    Attributes:
        fields: Name in lower case, type letter, bytes of an element, number of elements; '_' is padding, and any
            number of fields may have that name.
        count: How many points there are to be.
        width: Points of a row, or of all.
        height: Rows of an organised cloud, else 1.
        data: 'ascii', 'binary' or 'binary_compressed'.
    """

    fields: tuple[tuple[str, str, int, int], ...]
    count: int
    width: int
    height: int
    data: str

    @property
    def stride(self) -> int:
        """Bytes of a point."""
        return sum(size * count for _, _, size, count in self.fields)


def read_pcd(file: BinaryIO, size: int, wanted: Collection[str]) -> Content:
    """The `wanted` columns of a .pcd file of `size` bytes. VIEWPOINT is not used: points stay in the file's frame.

    Raises:
        UnreadableError: It is no .pcd file, or holds no points.
    """
    header = read_header(file)
    names = [name for name, *_ in header.fields]
    places, words, at, word = {}, {}, 0, 0
    for name, letter, bytes_, elements in header.fields:
        kind = _KINDS.get((letter, bytes_))
        if name in wanted and name not in places and kind is not None and elements == 1:
            places[name], words[name] = (at, kind), (word, kind)
        at, word = at + bytes_ * elements, word + elements
    left = size - file.tell()
    content = Content(names, 0, iter(()), header.height > 1)
    content.left_out([name for name in dict.fromkeys(names) if name in wanted and name not in places])
    if header.count != header.width * header.height:
        text = f"its header says POINTS {header.count}, but WIDTH {header.width} and HEIGHT {header.height}"
        content.faults.append(("odd header", f"{text}; POINTS is believed"))
    if header.data == "ascii":
        content.count = min(header.count, left // (2 * word) + 1)
        content.blocks = Columns(words, word).text(file, header.count, content)
    elif header.data == "binary":
        content.count = min(header.count, left // header.stride)
        content.blocks = Columns(places, header.stride).binary(file, content.count)
        if content.count < header.count:
            content.cut_short(content.count, header.count)
    else:
        decoded = _decompressed(file, left, header)
        content.count = _whole_points(header, len(decoded))
        content.blocks = _by_column(decoded, header, places, content.count)
        if content.count < header.count:
            content.cut_short(content.count, header.count)
    return content


def read_header(file: BinaryIO) -> Header:
    """The header of a .pcd file, which is left standing at the first point. Raises UnreadableError."""
    entries: dict[str, list[str]] = {}
    for line in header_lines(file):
        words = line.partition("#")[0].split()
        if not words:
            continue
        entries.setdefault(words[0].upper(), words[1:])
        if words[0].upper() == "DATA":
            break
        if words[0].upper() not in _ENTRIES:
            raise UnreadableError("not a .pcd file")
    names = [name.lower() for name in entries.get("FIELDS", entries.get("COLUMNS", []))]
    if not names:
        raise UnreadableError("its header names no fields")
    sizes, counts = (
        [whole_number(word, entry) for word in entries.get(entry, [default] * len(names))]
        for entry, default in (("SIZE", "4"), ("COUNT", "1"))
    )
    letters = [word.upper() for word in entries.get("TYPE", ["F"] * len(names))]
    if not len(names) == len(sizes) == len(letters) == len(counts):
        raise UnreadableError("its header has not as many SIZE, TYPE and COUNT as FIELDS")
    height = _single(entries, "HEIGHT", 1)
    width = _single(entries, "WIDTH", _single(entries, "POINTS", 0) // max(height, 1))
    data = " ".join(entries["DATA"][:1]).lower()
    if data not in ("ascii", "binary", "binary_compressed"):
        raise UnreadableError(f"its header says DATA {data[:20]}")
    if "POINTS" not in entries and "WIDTH" not in entries:
        raise UnreadableError("its header does not say how many points there are")
    header = Header(
        tuple(zip(names, letters, sizes, counts, strict=True)),
        _single(entries, "POINTS", width * height),
        width,
        height,
        data,
    )
    if header.stride == 0:
        raise UnreadableError("its header names no fields")
    return header


def _single(entries: Mapping[str, list[str]], entry: str, default: int) -> int:
    words = entries.get(entry)
    return default if words is None else whole_number(" ".join(words), entry)


def _decompressed(file: BinaryIO, left: int, header: Header) -> bytes:
    """What the compressed block holds, or the beginning of it where the file is cut short."""
    sizes = file.read(8)
    if len(sizes) < 8:
        return b""
    compressed, uncompressed = struct.unpack("<II", sizes)
    data = file.read(min(compressed, left - 8))
    if compressed == uncompressed:  # stored: it could not be made smaller
        return data
    if uncompressed > LZF_RATIO * (compressed + 1) or uncompressed > header.stride * max(header.count, 1):
        raise UnreadableError("damaged: its compressed points are not of the size that it says")
    if len(data) < compressed:
        data, uncompressed = _whole_instructions(data)
    if not uncompressed:
        return b""
    try:
        decoded = lzf.decompress(data, uncompressed)
    except ValueError:
        decoded = None
    if decoded is None or len(decoded) != uncompressed:
        raise UnreadableError("damaged: its compressed points cannot be unpacked")
    found: bytes = decoded
    return found


def _whole_instructions(data: bytes) -> tuple[bytes, int]:
    """The part of cut LZF data that can be unpacked, and the size of what comes out."""
    at, size, end = 0, 0, len(data)
    while at < end:
        control = data[at]
        if control < 32:  # so many literal bytes, and one
            step, made = control + 2, control + 1
        elif control < 224:
            step, made = 2, (control >> 5) + 2
        else:
            step, made = 3, (data[at + 1] if at + 1 < end else 0) + 9
        if at + step > end:
            break
        at, size = at + step, size + made
    return data[:at], size


def _whole_points(header: Header, size: int) -> int:
    """How many points have all of their fields in the first `size` bytes, which hold one field after the other."""
    whole, start = header.count, 0
    for _, _, bytes_, elements in header.fields:
        if bytes_ * elements:
            whole = min(whole, max(0, size - start) // (bytes_ * elements))
            start += bytes_ * elements * header.count
    return whole


def _by_column(
    decoded: bytes, header: Header, places: Mapping[str, tuple[int, np.dtype]], count: int
) -> Iterator[Block]:
    if not count:
        return
    columns: dict[str, Array] = {
        name: np.frombuffer(decoded, kind, count, at * header.count) for name, (at, kind) in places.items()
    }
    for start in range(0, count, AT_ONCE):
        yield {name: values[start : start + AT_ONCE] for name, values in columns.items()}


_ENTRIES = {"VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"}
_KINDS = {
    (letter, size): np.dtype(f"<{letter.lower()}{size}")
    for letter, sizes in {"F": (2, 4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}.items()
    for size in sizes
}
