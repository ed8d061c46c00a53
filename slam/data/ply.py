"""Stanford's .ply files: a header of text that describes any elements, then these as text or binary."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import BinaryIO

import numpy as np

from slam.data.point_blocks import (
    LINES,
    Block,
    Columns,
    Content,
    UnreadableError,
    header_lines,
    lines_of,
    whole_number,
)

FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4"},
    **{"double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8", "long": "i8", "ulong": "u8"},
}


@dataclass(frozen=True)
class Property:
    """A property's name in lower case and type; a list's has the type of the number that says how long it is."""

    name: str
    kind: np.dtype
    length: np.dtype | None = None


@dataclass
class Element:
    """One kind of thing in a file, and how many there are to be."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    @property
    def stride(self) -> int | None:
        """Bytes of one where all are the same, else None."""
        if any(each.length is not None for each in self.properties):
            return None
        return sum(each.kind.itemsize for each in self.properties)


def read_ply(file: BinaryIO, size: int, wanted: Collection[str]) -> Content:
    """The `wanted` columns of the vertices of a .ply file of `size` bytes.

    Raises:
        UnreadableError: It is no .ply file, or has no vertices.
    """
    order, elements = read_header(file)
    names = [element.name for element in elements]
    if "vertex" not in names or not elements[names.index("vertex")].properties:
        raise UnreadableError("its header names no vertices")
    before, vertex = elements[: names.index("vertex")], elements[names.index("vertex")]
    for element in before:
        _skip(file, element, order, size)
    left = max(0, size - file.tell())
    content = Content([each.name for each in vertex.properties], 0, iter(()))
    least = 2 * len(vertex.properties) if not order else vertex.stride or _least(vertex)
    content.count = min(vertex.count, left // least + (not order))
    if vertex.stride is None:
        rows = (row for row, _ in _rows(file.read(), vertex, order)) if order else _rows_of_text(file, vertex)
        content.blocks = _with_lists(rows, vertex, wanted, content)
    elif not order:
        words = {each.name: (at, each.kind) for at, each in reversed([*enumerate(vertex.properties)])}
        columns = Columns({name: words[name] for name in words if name in wanted}, len(vertex.properties))
        content.blocks = columns.text(file, vertex.count, content)
    else:
        content.blocks = Columns(_offsets(vertex, wanted), vertex.stride).binary(file, content.count)
        if content.count < vertex.count:
            content.cut_short(content.count, vertex.count)
    return content


def read_header(file: BinaryIO) -> tuple[str, list[Element]]:
    """The order of bytes ('' for text) and the elements; the file is left standing behind the header."""
    lines = header_lines(file)
    if file.read(3) != b"ply" or next(lines):
        raise UnreadableError("not a .ply file")
    order, elements = None, list[Element]()
    for line in lines:
        words = line.split()
        match words:
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["end_header"]:
                break
            case ["format", name, *_] if name in FORMATS and not elements:
                order = FORMATS[name]
            case ["element", name, count]:
                elements.append(Element(name.lower(), whole_number(count, f"element {name[:20]}")))
            case ["property", "list", length, kind, name] if elements and {length, kind} <= TYPES.keys():
                each = Property(name.lower(), _type(order, kind), _type(order, length))
                elements[-1].properties.append(each)
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append(Property(name.lower(), _type(order, kind)))
            case _:
                raise UnreadableError(f"its header has a line '{line[:60]}'")
    if order is None:
        raise UnreadableError("its header names no format")
    return order, elements


def _type(order: str | None, kind: str) -> np.dtype:
    return np.dtype((order or "<") + TYPES[kind])


def _least(element: Element) -> int:
    """Bytes of one with empty lists."""
    return sum((each.length or each.kind).itemsize for each in element.properties)


def _offsets(element: Element, wanted: Collection[str]) -> dict[str, tuple[int, np.dtype]]:
    places, at = {}, 0
    for each in element.properties:
        if each.name in wanted and each.name not in places:
            places[each.name] = (at, each.kind)
        at += each.kind.itemsize
    return places


def _skip(file: BinaryIO, element: Element, order: str, size: int) -> None:
    """Go past an element before the vertices, as far as the file goes."""
    if not element.properties:
        return
    if not order:
        for _ in islice((line for line in file if not line.isspace()), element.count):
            pass
    elif element.stride is not None:
        file.seek(min(size, file.tell() + element.count * element.stride))
    else:
        start = file.tell()
        ends = (end for _, end in islice(_rows(file.read(), element, order), element.count))
        file.seek(start + max(ends, default=0))


Row = list[float]


def _with_lists(rows: Iterator[Row], vertex: Element, wanted: Collection[str], content: Content) -> Iterator[Block]:
    """Vertices of any length, one by one."""
    scalars = [each for each in vertex.properties if each.length is None]
    read = 0
    while read < vertex.count:
        table = list(islice(rows, min(LINES, vertex.count - read)))
        if not table:
            content.cut_short(read, vertex.count)
            break
        read += len(table)
        columns = zip(scalars, zip(*table, strict=True), strict=True)
        with np.errstate(over="ignore"):
            yield {each.name: np.array(values).astype(each.kind) for each, values in columns if each.name in wanted}


def _rows(data: bytes, element: Element, order: str) -> Iterator[tuple[Row, int]]:
    """The scalars of each, to the end of the data, and where the next begins."""
    parts, scalars = [], ""
    for each in element.properties:
        if each.length is None:
            scalars += each.kind.char.replace("l", "q").replace("L", "Q")
        else:
            length = struct.Struct(order + scalars + each.length.char.replace("l", "q").replace("L", "Q"))
            parts.append((length, each.kind.itemsize))
            scalars = ""
    rest, at = struct.Struct(order + scalars), 0
    with contextlib.suppress(struct.error):  # at the end of the data
        while True:
            row: Row = []
            for length, size in parts:
                *values, count = length.unpack_from(data, at)
                row += values
                if not 0 <= count < 1 << 62 or count != int(count):
                    raise UnreadableError(f"damaged: a list of {count} numbers")
                at += length.size + int(count) * size
            row += rest.unpack_from(data, at)
            at += rest.size
            if at > len(data):
                return
            yield row, at


def _rows_of_text(file: BinaryIO, element: Element) -> Iterator[Row]:
    """The scalars of each, to the end of the file."""
    for line in lines_of(file):
        words, at, row = line.split(), 0, list[float]()
        try:
            for each in element.properties:
                if each.length is None:
                    row.append(float(words[at]) if each.kind.kind == "f" else int(words[at]))
                    at += 1
                else:
                    at += 1 + int(words[at])
        except (ValueError, IndexError):
            raise UnreadableError("damaged: a line has not the numbers that its header says") from None
        if at > len(words):
            return
        yield row
