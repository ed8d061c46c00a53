"""Scans of a user's own: .bin, .npy, .pcd and .ply files as columns of numbers, in whatever units they have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.files import read_bin, sound_points
from slam.data.problem import Problem

SUFFIXES = (".bin", ".pcd", ".ply", ".npy")
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
        problems: What is wrong with the file, and was gone around.
    """

    xyz: Array
    intensity: Array | None = None
    ring: Array | None = None
    times: Mapping[str, Array] = field(default_factory=dict)
    colour: Array | None = None
    problems: tuple[Problem, ...] = ()


def read_points(path: Path) -> Points:
    """The sound points of a scan; what is damaged is left out and reported.

    Points at the origin are left out silently: drivers write them where a laser got no answer. Raises InputError
    where the file holds something else than points.
    """
    suffix = path.suffix.lower()
    if suffix == ".bin":
        xyz, intensity, problems = read_bin(path)
        points = Points(xyz, intensity, problems=problems)
    else:
        points = _from_npy(path) if suffix == ".npy" else _from_open3d(path)
    return _sound(points, path)


def points_of(table: Array, name: Path) -> Points:
    """The sound points of an array in memory, as `read_points` has them of a file.

    Args:
        table: (N, 3) x y z or (N, 4) x y z intensity; or a structured array with fields x, y, z and, by any of the
            names that drivers use (`NAMES`), intensity, ring and time.
        name: What to call it in messages.

    Raises:
        InputError: The array is of another shape or has other fields.
    """
    return _sound(_from_table(table, name), name)


def _sound(points: Points, path: Path) -> Points:
    sound, found = sound_points(path, points.xyz)
    kept = sound & points.xyz.any(axis=1)
    if not kept.all():
        points = replace(
            points,
            xyz=points.xyz[kept],
            intensity=None if points.intensity is None else points.intensity[kept],
            ring=None if points.ring is None else points.ring[kept],
            times={name: values[kept] for name, values in points.times.items()},
            colour=None if points.colour is None else points.colour[kept],
        )
    problems = points.problems + found
    if not kept.any() and not any(problem.kind in ("empty scan", "missing scan") for problem in problems):
        problems += (Problem("empty scan", f"{path}: no points in it"),)
    return replace(points, problems=problems)


def _unreadable(path: Path, reason: str) -> Points:
    problem = Problem("missing scan", f"{path}: cannot be read ({reason}); no points used")
    return Points(np.zeros((0, 3), np.float32), problems=(problem,))


def _from_npy(path: Path) -> Points:
    try:
        with path.open("rb") as file:
            table = np.lib.format.read_array(file, allow_pickle=False)
    except OSError as error:
        return _unreadable(path, str(error.strerror or error))
    except ValueError as error:
        if "allow_pickle" in str(error):
            text = f"{path}: holds Python objects, which are not read; save a plain array: np.save(file, points)"
            raise InputError(text) from error
        return _unreadable(path, "damaged, or not an .npy file")
    return _from_table(table, path)


def _from_table(table: Array, path: Path) -> Points:
    if table.dtype.names:
        columns = {name.lower(): table[name].ravel() for name in table.dtype.names}
        if not {"x", "y", "z"} <= set(columns):
            raise InputError(f"{path}: fields x, y and z are needed; it has {', '.join(columns)}")
        return _from_columns(np.column_stack([columns[axis] for axis in "xyz"]), columns)
    if table.ndim != 2 or table.shape[1] not in (3, 4) or table.dtype.kind not in "fiu":
        raise InputError(f"{path}: {table.dtype} of shape {table.shape}; numbers of shape N x 3 or N x 4 are expected")
    return _from_columns(table[:, :3], {"intensity": table[:, 3]} if table.shape[1] == 4 else {})


def _from_open3d(path: Path) -> Points:
    if not path.is_file() or path.stat().st_size == 0:
        return _unreadable(path, "no such file" if not path.exists() else "nothing in it")
    import open3d  # takes a second to import, so only those who need it pay

    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        try:
            cloud = open3d.t.io.read_point_cloud(path)
        except RuntimeError:  # its message is for programmers
            cloud = None
    if cloud is None or "positions" not in cloud.point:
        return _unreadable(path, f"damaged, or not a {path.suffix} file with points")
    columns = {name.lower(): cloud.point[name].numpy() for name in cloud.point if name != "positions"}
    single = {name: column[:, 0] for name, column in columns.items() if column.ndim == 2 and column.shape[1] == 1}
    colour = columns.get("colors")
    points = _from_columns(cloud.point["positions"].numpy(), single)
    return points if colour is None or colour.dtype != np.uint8 else replace(points, colour=colour)


def _from_columns(xyz: Array, columns: Mapping[str, Array]) -> Points:
    with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinite, and is counted as such
        xyz = np.ascontiguousarray(xyz, np.float32)
    intensity, ring = (_first(columns, NAMES[kind]) for kind in ("intensity", "ring"))
    times = {name: columns[name] for name in NAMES["time"] if name in columns}
    return Points(xyz, intensity, ring, times)


def _first(columns: Mapping[str, Array], names: Sequence[str]) -> Array | None:
    return next((columns[name] for name in names if name in columns), None)
