"""PCL's .pcd files: a text header, then points as text, binary, or compressed column by column."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import BinaryIO

import lzf
import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import AT_ONCE, Block, Columns, Content, UnreadableError, header_lines, whole_number

#: Maximum compression ratio of LZF: 264 bytes are encoded in 3.
LZF_RATIO = 88


@dataclass(frozen=True)
class Header:
    """Header of a .pcd file.

    Attributes:
        fields: Name in lower case, type letter, bytes of an element, number of elements; any number of fields may have
            the name '_', which is padding.
        count: Stated number of points.
        width: Points per row of an organised cloud, else number of points.
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
    """Read the `wanted` columns of a .pcd file of `size` bytes; VIEWPOINT is ignored, points stay in the file's frame.

    Raises:
        UnreadableError: The file is damaged or not a .pcd file.
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
        text = f"the header states POINTS {header.count}, but WIDTH {header.width} and HEIGHT {header.height}"
        content.faults.append(("odd header", f"{text}; POINTS is used"))
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
        content.count = _complete_points(header, len(decoded))
        content.blocks = _by_column(decoded, header, places, content.count)
        if content.count < header.count:
            content.cut_short(content.count, header.count)
    return content


def read_header(file: BinaryIO) -> Header:
    """Read the header of a .pcd file, up to the first point.

    Raises:
        UnreadableError: The header is damaged, or the file is not a .pcd file.
    """
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
        raise UnreadableError("the header has no FIELDS")
    sizes, counts = (
        [whole_number(word, entry) for word in entries.get(entry, [default] * len(names))]
        for entry, default in (("SIZE", "4"), ("COUNT", "1"))
    )
    letters = [word.upper() for word in entries.get("TYPE", ["F"] * len(names))]
    if not len(names) == len(sizes) == len(letters) == len(counts):
        raise UnreadableError("the header has different numbers of FIELDS, SIZE, TYPE and COUNT")
    height = _single(entries, "HEIGHT", 1)
    width = _single(entries, "WIDTH", _single(entries, "POINTS", 0) // max(height, 1))
    data = " ".join(entries["DATA"][:1]).lower()
    if data not in ("ascii", "binary", "binary_compressed"):
        raise UnreadableError(f"the header states an unknown format, DATA {data[:20]}")
    if "POINTS" not in entries and "WIDTH" not in entries:
        raise UnreadableError("the header has neither POINTS nor WIDTH")
    header = Header(
        tuple(zip(names, letters, sizes, counts, strict=True)),
        _single(entries, "POINTS", width * height),
        width,
        height,
        data,
    )
    if header.stride == 0:
        raise UnreadableError("the fields of the header have no size")
    return header


def _single(entries: Mapping[str, list[str]], entry: str, default: int) -> int:
    words = entries.get(entry)
    return default if words is None else whole_number(" ".join(words), entry)


def _decompressed(file: BinaryIO, left: int, header: Header) -> bytes:
    """Decompress the block of points; if the file is truncated, the beginning of the block."""
    sizes = file.read(8)
    if len(sizes) < 8:
        return b""
    compressed, uncompressed = struct.unpack("<II", sizes)
    data = file.read(min(compressed, left - 8))
    if compressed == uncompressed:  # stored uncompressed, since compression did not make the block smaller
        return data
    if uncompressed > LZF_RATIO * (compressed + 1) or uncompressed > header.stride * max(header.count, 1):
        raise UnreadableError("damaged: the compressed points do not have the stated size")
    if len(data) < compressed:
        data, uncompressed = _complete_instructions(data)
    if not uncompressed:
        return b""
    try:
        decoded = lzf.decompress(data, uncompressed)
    except ValueError:
        decoded = None
    if decoded is None or len(decoded) != uncompressed:
        raise UnreadableError("damaged: the points cannot be decompressed")
    found: bytes = decoded
    return found


def _complete_instructions(data: bytes) -> tuple[bytes, int]:
    """The part of truncated LZF data that can be decompressed, and its decompressed size."""
    at, size, end = 0, 0, len(data)
    while at < end:
        control = data[at]
        if control < 32:  # control + 1 literal bytes follow
            step, made = control + 2, control + 1
        elif control < 224:
            step, made = 2, (control >> 5) + 2
        else:
            step, made = 3, (data[at + 1] if at + 1 < end else 0) + 9
        if at + step > end:
            break
        at, size = at + step, size + made
    return data[:at], size


def _complete_points(header: Header, size: int) -> int:
    """Number of points whose fields all lie in the first `size` bytes, where the fields are stored one by one."""
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
