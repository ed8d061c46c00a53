"""Scans of a user's own: .bin, .npy, .pcd, .ply, .las and .laz files as columns of numbers, in whatever units they
have."""

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
#: What drivers call the same thing (Velodyne, Ouster, Hesai, Livox, RoboSense, CloudCompare), in lower case.
NAMES = {
    "intensity": ("intensity", "i", "reflectivity", "reflectance", "remission", "scalar_intensity"),
    "ring": ("ring", "laser_id", "laser", "channel", "line", "scalar_ring"),
    # The first that tells anything of a scan is used: relative times before those of a clock.
    "time": (
        *("time", "t", "timestamp", "time_offset", "offset_time", "time_stamp", "scalar_time"),
        *("times", "timestamps", "stamp", "stamps", "offset_times", "time_offsets", "offsettime", "timeoffset"),
        *("point_time", "relative_time", "rel_time", "delta_time", "dt", "time_ns", "t_ns", "time_us", "t_us"),
        *("gps_time", "gpstime", "scalar_t", "scalar_timestamp", "scalar_gpstime", "scalar_gps_time"),
    ),
}
#: Colour in one number, as PCL packs it, or in three.
PACKED, CHANNELS = ("rgb", "rgba"), (("red", "green", "blue"), ("r", "g", "b"))
WANTED = frozenset(name for names in ("xyz", *NAMES.values(), PACKED, *CHANNELS) for name in names)


@dataclass(frozen=True, eq=False)
class Points:
    """N points as a file has them.

    Attributes:
        xyz: (N, 3) float32, metres.
        intensity: (N,) in the file's unit and type, or None.
        ring: (N,) in the file's order and type, or None.
        times: Every field that may be the points' time, (N,) in the file's unit and type (uint32 ns, float64 s, ...),
            by its name in lower case, in the order of `NAMES["time"]`.
        colour: (N, 3) uint8 RGB, or None.
        offset: What was subtracted from the file's coordinates [m], which are those of a map's frame if it is not 0.
        problems: What is wrong with the file, and was gone around.
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
    """How the scans of a drive are to be read, where the files do not say it.

    Attributes:
        layout: The columns of tables without names: .bin, and .npy of other than 3 or 4 columns.
        offset: What to subtract from coordinates in a map's frame [m], the same for all scans.
        axes: How to make x forward, y left, z up [m] of the file's coordinates, where they are others.
        image: What the points' places in the file say of their rings and times, where they say it.
    """

    layout: Layout | None = None
    offset: Offset | None = None
    axes: Axes | None = None
    image: PointImage | None = None


def read_points(path: Path, reading: Reading = Reading()) -> Points:  # immutable
    """The sound points of a scan; what is damaged is left out and reported. Nothing in a file raises.

    Points at the origin, and NaN where a laser got no answer, are left out silently. What cannot be read at all gives
    no points and the problem 'missing scan'.

    Args:
        path: A file with one of `SUFFIXES`.
        reading: What the file does not say; where nobody does, the file's own points have to tell.

    Raises:
        InputError: The file is LAS, and laspy is not installed.
    """
    return _read(path, reading, everything=False)


def read_cloud(path: Path) -> Points:
    """All finite points of a map, however far they are from its origin. See `read_points`."""
    return _read(path, Reading(), everything=True)


def points_of(table: Array, name: Path, offset: Offset | None = None) -> Points:
    """The sound points of an array in memory, as `read_points` has them of a file.

    Args:
        table: (N, 3) x y z or (N, 4) x y z intensity; or a structured array with fields x, y, z and, by any of the
            names that drivers use (`NAMES`), intensity, ring and time.
        name: What to call it in messages.
        offset: What to subtract from coordinates in a map's frame [m]. By default its own points tell.

    Raises:
        InputError: The array is of another shape or has other fields.
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
    """The points of an open file: see `read_points`. `path` is for messages, and its suffix says what the file is."""
    try:
        size = file.seek(0, 2)
        file.seek(0)
        if size == 0 and path.suffix.lower() != ".bin":
            raise UnreadableError("nothing in it")
        content = _content(file, size, path, reading)
        content = content if reading.image is None else with_places(content, reading.image)
        content = content if reading.axes is None else in_axes(content, reading.axes)
        return _points(content, path, reading.offset, everything)
    except UnreadableError as error:
        return _unreadable(path, str(error))
    except MemoryError:
        return _unreadable(path, "too large for the memory of this machine")


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
        problems.append(Problem("empty scan", f"{path}: no points in it"))
    elif offset is None and any(subtracted):
        problems.append(Problem("map coordinates", f"{path}: {map_frame(subtracted)}"))
    intensity, ring = (_first(found, NAMES[kind]) for kind in ("intensity", "ring"))
    times = {name: found[name] for name in NAMES["time"] if name in found}
    return Points(found["xyz"], intensity, ring, times, _colour(found), subtracted, tuple(problems))


def _first(columns: Mapping[str, Array], names: Sequence[str]) -> Array | None:
    return next((columns[name] for name in names if name in columns), None)


def _colour(columns: Mapping[str, Array]) -> Array | None:
    """(N, 3) uint8 of three columns, or of one in which red is the third byte from the right."""
    packed = _first(columns, PACKED)
    names = next((names for names in CHANNELS if columns.keys() >= set(names)), None)
    with np.errstate(over="ignore", invalid="ignore"):  # of damaged files
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
