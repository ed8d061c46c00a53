"""Point files (.bin, .npy, .pcd, .ply, .las, .laz) as columns of numbers, in the units of the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from slam.data.bin_layout import Layout, read_bin, told_layout
from slam.data.cloud import Array
from slam.data.derived_columns import Axes, PointImage, in_axes, with_places
from slam.data.errors import InputError
from slam.data.npy import columns_of, read_npy
from slam.data.pcd import read_pcd
from slam.data.ply import read_ply
from slam.data.point_blocks import Content, UnreadableError
from slam.data.problem import Problem
from slam.data.sound_points import Offset, gathered, map_frame

SUFFIXES = (".bin", ".pcd", ".ply", ".npy", ".las", ".laz")
#: Names of fields as drivers write them (Velodyne, Ouster, Hesai, Livox, RoboSense, CloudCompare), in lower case.
NAMES = {
    "intensity": ("intensity", "i", "reflectivity", "reflectance", "remission", "scalar_intensity"),
    "ring": ("ring", "laser_id", "laser", "channel", "line", "scalar_ring"),
    # The first field with usable times is taken: relative times before absolute ones.
    "time": (
        *("time", "t", "timestamp", "time_offset", "offset_time", "time_stamp", "scalar_time"),
        *("times", "timestamps", "stamp", "stamps", "offset_times", "time_offsets", "offsettime", "timeoffset"),
        *("point_time", "relative_time", "rel_time", "delta_time", "dt", "time_ns", "t_ns", "time_us", "t_us"),
        *("gps_time", "gpstime", "scalar_t", "scalar_timestamp", "scalar_gpstime", "scalar_gps_time"),
    ),
}
#: Fields of colour: packed into one number as PCL does, or three numbers.
PACKED, CHANNELS = ("rgb", "rgba"), (("red", "green", "blue"), ("r", "g", "b"))
WANTED = frozenset(name for names in ("xyz", *NAMES.values(), PACKED, *CHANNELS) for name in names)


@dataclass(frozen=True, eq=False)
class Points:
    """N points as recorded in a file.

    Attributes:
        xyz: (N, 3) float32 [m].
        intensity: (N,) in the file's unit and type, or None.
        ring: (N,) in the file's order and type, or None.
        times: Every field that may hold the point times, (N,) in the file's unit and type (uint32 ns, float64 s, ...),
            by its name in lower case, in the order of `NAMES["time"]`.
        colour: (N, 3) uint8 RGB, or None.
        offset: Offset that was subtracted from the file's coordinates [m]; not 0 for coordinates in a map frame.
        problems: Faults of the file, and how they were handled.
    """

    xyz: Array
    intensity: Array | None = None
    ring: Array | None = None
    times: Mapping[str, Array] = field(default_factory=dict)
    colour: Array | None = None
    offset: Offset = (0.0, 0.0, 0.0)
    problems: tuple[Problem, ...] = ()


@dataclass(frozen=True)
class Reading:
    """Properties of a sequence's files that the files do not state.

    Attributes:
        layout: Columns of tables without names: .bin, and .npy of other than 3 or 4 columns.
        offset: Offset to subtract from coordinates in a map frame [m], the same for all scans.
        axes: Conversion of the file's coordinates to x forward, y left, z up [m], if they have other axes.
        image: Rings and times by the place of a point in the file, if it determines them.
    """

    layout: Layout | None = None
    offset: Offset | None = None
    axes: Axes | None = None
    image: PointImage | None = None


def read_points(path: Path, reading: Reading = Reading()) -> Points:  # immutable
    """Read the valid points of a scan; damaged points are left out and reported. No content of a file raises.

    Points at the origin and points of NaN, which stand for missing returns, are left out without a report. A file that
    cannot be read gives no points and the problem 'missing scan'.

    Args:
        path: A file with one of `SUFFIXES`.
        reading: Properties that the file does not state; those that are None are estimated from the file's points.

    Raises:
        InputError: The file is LAS or LAZ, and laspy is not installed.
    """
    return _read(path, reading, everything=False)


def read_cloud(path: Path) -> Points:
    """Read all finite points of a map, at any distance from the origin; see `read_points`."""
    return _read(path, Reading(), everything=True)


def points_of(table: Array, name: Path, offset: Offset | None = None) -> Points:
    """Return the valid points of an array in memory, as `read_points` does for a file.

    Args:
        table: (N, 3) x y z or (N, 4) x y z intensity; or a structured array with fields x, y, z and, under any of the
            names in `NAMES`, intensity, ring and time.
        name: Name of the array in messages.
        offset: Offset to subtract from coordinates in a map frame [m]. Default: estimated from its own points.

    Raises:
        InputError: The array has another shape or lacks a field.
    """
    try:
        return _points(columns_of(table, WANTED), name, offset, everything=False)
    except UnreadableError as error:
        raise InputError(f"{name}: {error}") from error


def _read(path: Path, reading: Reading, everything: bool) -> Points:
    try:
        with path.open("rb") as file:
            return points_in(file, path, reading, everything)
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else str(error.strerror or error)
    return _unreadable(path, reason)


def points_in(file: BinaryIO, path: Path, reading: Reading = Reading(), everything: bool = False) -> Points:
    """Read the points of an open file, see `read_points`; `path` gives the format by its suffix, and the messages."""
    try:
        size = file.seek(0, 2)
        file.seek(0)
        if size == 0 and path.suffix.lower() != ".bin":
            raise UnreadableError("the file is empty")
        content = _content(file, size, path, reading)
        content = content if reading.image is None else with_places(content, reading.image)
        content = content if reading.axes is None else in_axes(content, reading.axes)
        return _points(content, path, reading.offset, everything)
    except UnreadableError as error:
        return _unreadable(path, str(error))
    except MemoryError:
        return _unreadable(path, "too large for this machine's memory")


def _unreadable(path: Path, reason: str) -> Points:
    problem = Problem("missing scan", f"{path}: cannot be read ({reason}); no points used")
    return Points(np.zeros((0, 3), np.float32), problems=(problem,))


def _content(file: BinaryIO, size: int, path: Path, reading: Reading) -> Content:
    match path.suffix.lower():
        case ".bin":
            return read_bin(file, size, WANTED, reading.layout or told_layout([file]))
        case ".npy":
            return read_npy(file, size, WANTED, None if reading.layout is None else reading.layout.names)
        case ".pcd":
            return read_pcd(file, size, WANTED)
        case ".ply":
            return read_ply(file, size, WANTED)
        case ".las" | ".laz":
            from slam.data.las import read_las

            return read_las(file, size, WANTED, path)
        case ".feather":
            from slam.data.feather import read_feather

            return read_feather(file, WANTED, path)
        case suffix:
            raise UnreadableError(f"'{suffix}' is not one of {', '.join(SUFFIXES)}")


def _points(content: Content, path: Path, offset: Offset | None, everything: bool) -> Points:
    found, subtracted = gathered(content, everything, offset)
    problems = [Problem(kind, f"{path}: {text}") for kind, text in content.faults]
    if len(found["xyz"]) == 0:
        problems.append(Problem("empty scan", f"{path}: contains no points"))
    elif offset is None and any(subtracted):
        problems.append(Problem("map coordinates", f"{path}: {map_frame(subtracted)}"))
    intensity, ring = (_first(found, NAMES[kind]) for kind in ("intensity", "ring"))
    times = {name: found[name] for name in NAMES["time"] if name in found}
    return Points(found["xyz"], intensity, ring, times, _colour(found), subtracted, tuple(problems))


def _first(columns: Mapping[str, Array], names: Sequence[str]) -> Array | None:
    return next((columns[name] for name in names if name in columns), None)


def _colour(columns: Mapping[str, Array]) -> Array | None:
    """Colour (N, 3) uint8 from three columns, or from one packed as 0xRRGGBB."""
    packed = _first(columns, PACKED)
    names = next((names for names in CHANNELS if columns.keys() >= set(names)), None)
    with np.errstate(over="ignore", invalid="ignore"):  # damaged files may have any value
        if packed is not None:
            bits = packed.astype(np.float32).view(np.uint32) if packed.dtype.kind == "f" else packed.astype(np.uint32)
            return np.column_stack([bits >> 16, bits >> 8, bits]).astype(np.uint8)
        if names is None:
            return None
        colour = np.column_stack([columns[name] for name in names])
        highest = colour.max(initial=0)
        if colour.dtype.kind == "f" and highest <= 1:
            colour = colour * 255
        elif colour.dtype.kind != "f" and highest > 255:  # LAS: 16 bits
            colour = colour >> 8
        return colour.astype(np.uint8)
