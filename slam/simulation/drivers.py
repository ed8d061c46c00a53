"""Point fields of LiDAR drivers: names, units and order, and the instant that times refer to.

Field names, types and offsets are those of the drivers for ROS: velodyne_pointcloud's PointXYZIRT, ouster_ros's
original type, HesaiLidar_ROS, rslidar_sdk's XYZIRT, livox_ros_driver2's CustomMsg.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.recordings.clouds import LIVOX_POINT
from slam.simulation.lidar import Scan


def _point(step: int, **fields: tuple[str, int]) -> np.dtype:
    """A point of `step` bytes with fields of a type at an offset."""
    kinds, offsets = zip(*fields.values(), strict=True)
    xyz, at = ["<f4"] * 3, [0, 4, 8]
    return np.dtype(
        {"names": [*"xyz", *fields], "formats": [*xyz, *kinds], "offsets": [*at, *offsets], "itemsize": step}
    )


VELODYNE = _point(22, intensity=("<f4", 12), ring=("<u2", 16), time=("<f4", 18))
OUSTER = _point(
    48,
    **{"intensity": ("<f4", 16), "t": ("<u4", 20), "reflectivity": ("<u2", 24), "ring": ("<u2", 26)},
    **{"ambient": ("<u2", 28), "range": ("<u4", 32)},
)
HESAI = _point(48, intensity=("<f4", 16), timestamp=("<f8", 24), ring=("<u2", 32))
ROBOSENSE = _point(26, intensity=("<f4", 12), ring=("<u2", 16), timestamp=("<f8", 18))
LIVOX = np.dtype([(name, f"<{kind}") for name, kind in LIVOX_POINT])


@dataclass(frozen=True)
class Timing:
    """When a sweep was, and of what.

    Attributes:
        begin: Of the sweep [s].
        instant: To which the stamp of its scan belongs, as a fraction of the sweep.
        period: Seconds that it takes.
        rings: Of the LiDAR, and
        columns: pulses of each in a turn.
        moving: Whether the sensor moves meanwhile; if not, all points are said to be seen at once.
    """

    begin: float
    instant: float
    period: float
    rings: int
    columns: int
    moving: bool = True

    def elapsed(self, scan: Scan) -> Array:
        """(N,) float64: seconds since the begin."""
        return scan.fraction.astype(np.float64) * (self.period if self.moving else 0.0)


@dataclass(frozen=True)
class Driver:
    """A driver.

    Attributes:
        fill: Makes its points, (N,) or organised, of a scan.
        stamp: The instant of the sweep that its scans are stamped with.
        fixed: Whether it is always that one, since points' times count from it and are not negative.
        topic: Where its scans are published, and
        frame: their frame.
        sensors: How the names of LiDARs begin that it is the driver of.
        dense: Whether points without return are left out.
    """

    fill: Callable[[Scan, Timing], Array]
    stamp: str
    fixed: bool
    topic: str
    frame: str
    sensors: tuple[str, ...] = ()
    dense: bool = True

    def stamp_or(self, said: str | None, name: str) -> str:
        """Return the stamp's instant: `said`, or the driver's own. Raises InputError if it has another."""
        if said not in (None, self.stamp) and self.fixed:
            raise InputError(f"--stamp {said}: the driver {name} stamps the {self.stamp} of a sweep; leave it out")
        return said or self.stamp


def _velodyne(scan: Scan, timing: Timing) -> Array:
    """In the order of firing; rings from the bottom, times from the stamp."""
    points = _filled(scan, VELODYNE)
    points["intensity"], points["ring"] = np.round(255 * scan.reflectance), timing.rings - 1 - scan.ring
    if timing.moving:
        points["time"] = (scan.fraction - np.float32(timing.instant)) * np.float32(timing.period)
    return points[np.argsort(scan.fraction, kind="stable")]


def _ouster(scan: Scan, timing: Timing) -> Array:
    """Organised, rings from the top by columns, all 0 where there is no return; ns from the start."""
    points = _filled(scan, OUSTER)
    points["intensity"], points["ring"] = np.round(2000 * scan.reflectance), scan.ring
    points["reflectivity"], points["ambient"] = np.round(255 * scan.reflectance), 40
    points["t"] = np.round(timing.elapsed(scan) * 1e9)
    points["range"] = np.round(1000 * np.linalg.norm(scan.xyz, axis=1))
    return _organised(points, scan, timing, np.zeros(1, OUSTER))


def _hesai(scan: Scan, timing: Timing) -> Array:
    """In the order of firing; rings from the top, times of the clock."""
    points = _filled(scan, HESAI)
    points["intensity"], points["ring"] = np.round(255 * scan.reflectance), scan.ring
    points["timestamp"] = timing.begin + timing.elapsed(scan)
    return points[np.argsort(scan.fraction, kind="stable")]


def _robosense(scan: Scan, timing: Timing) -> Array:
    """Organised column by column, NaN where there is no return; rings from the bottom, times of the clock."""
    points = _filled(scan, ROBOSENSE)
    points["intensity"], points["ring"] = np.round(255 * scan.reflectance), timing.rings - 1 - scan.ring
    points["timestamp"] = timing.begin + timing.elapsed(scan)
    none = np.zeros(1, ROBOSENSE)
    for axis in "xyz":
        none[axis] = np.nan
    none["timestamp"] = timing.begin
    return np.ascontiguousarray(_organised(points, scan, timing, none).T)


def _livox(scan: Scan, timing: Timing) -> Array:
    """In the order of firing; lines from the top, ns from the start."""
    points = _filled(scan, LIVOX)
    points["reflectivity"], points["line"] = np.round(255 * scan.reflectance), scan.ring
    points["offset_time"] = np.round(timing.elapsed(scan) * 1e9)
    points["tag"] = 0x10
    return points[np.argsort(scan.fraction, kind="stable")]


def _filled(scan: Scan, kind: np.dtype) -> Array:
    points = np.zeros(len(scan.xyz), kind)
    for axis, name in enumerate("xyz"):
        points[name] = scan.xyz[:, axis]
    return points


def _organised(points: Array, scan: Scan, timing: Timing, none: Array) -> Array:
    """(R, columns) by ring and column of the turn, `none` (1,) where there is no return."""
    image = np.tile(none, (timing.rings, timing.columns))
    column = np.minimum((scan.fraction * np.float32(timing.columns)).astype(np.int64), timing.columns - 1)
    image[scan.ring, column] = points
    return image


#: By the names that users give them.
DRIVERS = {
    "velodyne": Driver(_velodyne, "end", False, "/velodyne_points", "velodyne", ("vlp", "hdl", "vls", "puck")),
    "ouster": Driver(_ouster, "start", True, "/ouster/points", "os_sensor", ("os",), dense=False),
    "hesai": Driver(_hesai, "start", False, "/hesai/pandar", "hesai_lidar", ("pandar", "xt", "qt")),
    "robosense": Driver(_robosense, "end", False, "/rslidar_points", "rslidar", ("rs-",), dense=False),
    "livox": Driver(_livox, "start", True, "/livox/lidar", "livox_frame"),
}


def usual_driver(sensor: str) -> str:
    """The name of the driver of a LiDAR that is built in."""
    names = (name for name, driver in DRIVERS.items() if sensor.startswith(driver.sensors or ("?",)))
    return next(names, "velodyne")
