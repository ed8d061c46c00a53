"""LAS and LAZ, the files of surveyors and GIS, through laspy, which is an extra: `pip install 'lidarlift[las]'`."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.data.point_blocks import AT_ONCE, Block, Columns, Content, UnreadableError

if TYPE_CHECKING:
    import laspy

#: Coordinates are written in whole millimetres.
STEP = 0.001


def read_las(file: BinaryIO, size: int, wanted: Collection[str], path: Path) -> Content:
    """The `wanted` columns of a .las or .laz file of `size` bytes; fields that a program added included.

    Raises:
        UnreadableError: It is no LAS file.
        InputError: laspy is not installed.
    """
    laspy = _laspy(path)
    try:
        _check_sizes(file.read(375), size)
        file.seek(0)
        reader = laspy.LasReader(file, closefd=False, laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False)
        header = reader.header
        kind = header.point_format.dtype()
        if header.are_points_compressed and header.point_count:
            _check_items(header.vlrs[header.vlrs.index("LasZipVlr")].record_data, kind.itemsize)
            _check_chunks(file, size, header.offset_to_point_data)
    except UnreadableError:
        raise
    except Exception as error:  # laspy raises what Python happens to on headers that are none
        raise UnreadableError("damaged, or not a LAS file") from error
    names = {name.lower(): name for name in kind.names or ()}
    content = Content(list(names), header.point_count, iter(()))
    used = {name: names[name] for name in names if name in wanted}
    if header.are_points_compressed:
        content.count = min(header.point_count, AT_ONCE)
        tables = _unpacked(reader, content)
    else:
        content.count = min(header.point_count, max(0, size - header.offset_to_point_data) // kind.itemsize)
        if content.count < header.point_count:
            content.cut_short(content.count, header.point_count)
        file.seek(header.offset_to_point_data)
        places = {name: (kind.fields[name][1], kind.fields[name][0]) for name in used.values()}
        tables = Columns(places, kind.itemsize).binary(file, content.count)
    content.blocks = _scaled(tables, used, header)
    return content


def write_las(path: Path, cloud: PointCloud) -> None:
    """A cloud as .las or .laz, by the suffix: coordinates in millimetres, intensity 0..65535, colour where there is.

    Raises InputError where laspy is not installed.
    """
    laspy = _laspy(path)
    header = laspy.LasHeader(point_format=0 if cloud.colour is None else 2, version="1.2")
    low = cloud.xyz.min(axis=0).astype(np.float64)
    header.offsets, header.scales = np.floor(low), np.full(3, STEP)
    points: Any = laspy.LasData(header)
    points.x, points.y, points.z = cloud.xyz.astype(np.float64).T
    points.intensity = np.round(np.clip(cloud.intensity, 0, 1) * 65535).astype(np.uint16)
    if cloud.colour is not None:
        points.red, points.green, points.blue = cloud.colour.T.astype(np.uint16) * 257
    points.write(str(path))


def _laspy(path: Path) -> Any:
    try:
        import laspy
    except ImportError as error:
        raise InputError(f"{path}: LAS needs the package laspy: pip install 'lidarlift[las]'") from error
    return laspy


def _check_sizes(header: bytes, size: int) -> None:
    """Raise UnreadableError where the header speaks of more than the file has, which laspy would look for."""
    if len(header) < 227 or header[:4] != b"LASF":
        raise UnreadableError("not a LAS file")
    points, records = (int.from_bytes(header[at : at + 4], "little") for at in (96, 100))
    if points > size or 54 * records > points:
        raise UnreadableError("damaged: its header says more than the file has")


#: What the layers of a .laz point are, by LASzip's numbers, and their bytes; None for any.
ITEMS = {0: None, 6: 20, 7: 8, 8: 6, 9: 29, 10: 30, 11: 6, 12: 8, 13: 29, 14: None}


def _check_items(record: bytes, size: int) -> None:
    """The same of the parts that a .laz point of `size` bytes is packed as: lazrs panics where they do not fit."""
    count = int.from_bytes(record[32:34], "little")
    items = [record[at : at + 6] for at in range(34, 34 + 6 * count, 6)]
    kinds, sizes = ([int.from_bytes(item[at : at + 2], "little") for item in items] for at in (0, 2))
    known = all(ITEMS.get(kind, 0) in (None, each) for kind, each in zip(kinds, sizes, strict=True))
    if not (items and known and sum(sizes) == size):
        raise UnreadableError("damaged: its points are packed in an unknown way")


def _check_chunks(file: BinaryIO, size: int, start: int) -> None:
    """The same of the table of chunks in a .laz file. lazrs takes memory for as many as it names, and aborts."""
    for place in (start, size - 8):  # the table's place stands before the points, or at the end where it was streamed
        file.seek(place)
        at = int.from_bytes(file.read(8), "little", signed=True)
        if at != -1:
            break
    file.seek(max(0, at))
    table = file.read(8)
    if not start < at <= size - 8 or int.from_bytes(table[4:], "little") > size:
        raise UnreadableError("damaged: its table of chunks cannot be read")
    file.seek(start)


def _unpacked(reader: laspy.LasReader, content: Content) -> Iterator[Block]:
    """The points of a .laz file, as far as it can be unpacked."""
    read, promised = 0, reader.header.point_count
    while read < promised:
        try:
            table = reader.read_points(min(AT_ONCE, promised - read)).array
        except BaseException as error:  # lazrs panics with an exception that is no Exception
            if isinstance(error, KeyboardInterrupt | SystemExit | GeneratorExit):
                raise
            table = []
        if len(table) == 0:
            content.cut_short(read, promised)
            return
        yield table
        read += len(table)


def _scaled(tables: Iterator[Any], used: dict[str, str], header: Any) -> Iterator[Block]:
    for table in tables:
        block: dict[str, Array] = {name: table[own] for name, own in used.items()}
        for axis, scale, offset in zip("xyz", header.scales, header.offsets, strict=True):
            if axis in block:
                with np.errstate(over="ignore", invalid="ignore"):  # of a damaged header
                    block[axis] = block[axis] * scale + offset
        yield block
