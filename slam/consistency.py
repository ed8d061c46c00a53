"""Whether a scan can show the scene of the last one: damaged scans register too, at some wrong pose.

Mirrored or swapped axes keep ground and walls, of which many fit anywhere; but other surfaces then stand where the last
scan looked through. Random bytes lie at other ranges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.distortion import Correction

MAX_RANGE_CHANGE = 0.7  # total variation distance of the ranges' histograms; sound: up to 0.1, random bytes: 0.85
SAMPLE = 8000  # points of a scan that are compared
RANGES = np.array([0.0, 2.0, 5.0, 8.0, 12.0, 18.0, 25.0, 35.0, 50.0, 80.0, np.inf])  # m
CELL = 2.0  # deg, of a view: as far apart as the rings of a sparse LiDAR
NEAREST = 3.0  # m; nearer points are the vehicle itself
MARGIN = 0.1, 0.5  # of the range, and m: how much nearer than all that was seen in the cells around is in free space


class LastScan:
    """The last registered scan, with which the next one must be consistent."""

    def __init__(self) -> None:
        self._sample, self._pose = Sample(np.zeros((0, 3), np.float32), np.zeros(0)), np.eye(4)

    def keep(self, some: Sample, pose: Array) -> None:
        """Keep a scan, with its pose (4, 4)."""
        self._sample, self._pose = some, pose

    def resembles(self, some: Sample) -> bool:
        """Check whether the points of a scan lie at ranges as those of the last one do."""
        known = min(len(some.xyz), len(self._sample.xyz)) > 0
        return not known or range_change(some.ranges, self._sample.ranges) <= MAX_RANGE_CHANGE

    def conflicts(self, some: Sample, pose: Array) -> float:
        """Return the share of points in space that the other scan looked through: of this or of the last, the larger.

        Args:
            some: Points of a scan.
            pose: Its pose (4, 4).
        """
        last, T_before_now = self._sample.xyz, se3.inverse(self._pose) @ pose
        return max(conflicts(last, some.xyz, T_before_now), conflicts(some.xyz, last, se3.inverse(T_before_now)))


@dataclass(frozen=True, eq=False)
class Sample:
    """Some points of a scan.

    Attributes:
        xyz: (N, 3) float32, in the sensor's frame.
        ranges: Shares of the points in the intervals of `RANGES`.
    """

    xyz: Array
    ranges: Array


def sample(cloud: PointCloud, correction: Correction) -> Sample:
    """Return some of the points of a scan as recorded, evenly, corrected."""
    some = slice(None, None, max(1, len(cloud) // SAMPLE))
    time = None if cloud.time is None else np.ascontiguousarray(cloud.time[some])
    xyz = correction.points(np.ascontiguousarray(cloud.xyz[some]), time)  # not strided: no further compilation
    return Sample(xyz, range_shares(xyz))


def range_change(shares: Array, other: Array) -> float:
    """Return the total variation distance, 0 to 1, of the `range_shares` of two scans."""
    return float(np.abs(shares - other).sum()) / 2


def range_shares(xyz: Array) -> Array:
    """Return the shares of the points (N, 3) in the intervals of `RANGES`."""
    squared = np.einsum("ij,ij->i", xyz, xyz)
    beyond = [np.count_nonzero(squared >= limit * limit) for limit in RANGES[:-1]]
    return -np.diff([*beyond, 0]) / max(len(xyz), 1)


def conflicts(viewed: Array, xyz: Array, T_view_points: Array) -> float:
    """Return the share of points that lie in space that another scan looked through.

    Args:
        viewed: Points (N, 3) of that scan.
        xyz: Points (M, 3); those in directions without points of the other scan do not count.
        T_view_points: (4, 4).
    """
    shape = int(360 / CELL), int(180 / CELL) + 1
    nearest = np.full(shape[0] * shape[1], np.inf)
    np.minimum.at(nearest, _cells(viewed, shape), np.linalg.norm(viewed, axis=1))
    around = nearest.reshape(shape)
    for axis in (0, 1):
        around = np.minimum(around, np.minimum(np.roll(around, 1, axis), np.roll(around, -1, axis)))
    moved = xyz @ T_view_points[:3, :3].T + T_view_points[:3, 3]
    distance, cells = np.linalg.norm(moved, axis=1), _cells(moved, shape)
    counted = np.isfinite(nearest[cells]) & (distance > NEAREST)
    free = distance < (1 - MARGIN[0]) * around.ravel()[cells] - MARGIN[1]
    return float(free[counted].mean()) if counted.any() else 0.0


def _cells(xyz: Array, shape: tuple[int, int]) -> Array:
    """Indices (N,) of the cells of a view, by azimuth and elevation, of points (N, 3)."""
    azimuth = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0])) % 360
    elevation = np.rad2deg(np.arctan2(xyz[:, 2], np.sqrt(xyz[:, 0] ** 2 + xyz[:, 1] ** 2))) + 90
    return np.asarray((azimuth / CELL).astype(int) % shape[0] * shape[1] + (elevation / CELL).astype(int))
