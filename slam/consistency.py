"""Whether a scan can show the scene of the last one: damaged scans register too, at some wrong pose.

Mirrored or swapped axes keep ground and walls, of which many fit anywhere; but other surfaces then stand where the last
scan looked through. Random bytes lie at other ranges.
"""

from __future__ import annotations

import numpy as np

from slam.data import se3
from slam.data.cloud import Array

MAX_RANGE_CHANGE = 0.7  # total variation distance of the ranges' histograms; sound: up to 0.1, random bytes: 0.85
SAMPLE = 8000  # points of a scan that are compared
RANGES = np.array([0.0, 2.0, 5.0, 8.0, 12.0, 18.0, 25.0, 35.0, 50.0, 80.0, np.inf])  # m
CELL = 2.0  # deg, of a view: as far apart as the rings of a sparse LiDAR
NEAREST = 3.0  # m; nearer points are the vehicle itself
MARGIN = 0.1, 0.5  # of the range, and m: how much nearer than all that was seen in the cells around is in free space


class LastScan:
    """The last registered scan, with which the next one must be consistent."""

    def __init__(self) -> None:
        self._xyz, self._pose = np.zeros((0, 3), np.float32), np.eye(4)

    def keep(self, xyz: Array, pose: Array) -> None:
        """Keep a scan: points (N, 3) in the sensor's frame, and its pose (4, 4)."""
        self._xyz, self._pose = _sample(xyz), pose

    def resembles(self, xyz: Array) -> bool:
        """Check whether the points (N, 3) of a scan lie at ranges as those of the last one do."""
        some = _sample(xyz)
        return min(len(some), len(self._xyz)) == 0 or range_change(self._xyz, some) <= MAX_RANGE_CHANGE

    def conflicts(self, xyz: Array, pose: Array) -> float:
        """Return the share of points in space that the other scan looked through: of this or of the last, the larger.

        Args:
            xyz: Points (N, 3) in the sensor's frame.
            pose: Pose (4, 4).
        """
        some, T_before_now = _sample(xyz), se3.inverse(self._pose) @ pose
        return max(conflicts(self._xyz, some, T_before_now), conflicts(some, self._xyz, se3.inverse(T_before_now)))


def range_change(xyz: Array, other: Array) -> float:
    """Return the total variation distance, 0 to 1, of the ranges of points (N, 3) and of others (M, 3)."""
    return float(np.abs(_range_shares(xyz) - _range_shares(other)).sum()) / 2


def _range_shares(xyz: Array) -> Array:
    """Shares of the points (N, 3) in the intervals of `RANGES`."""
    squared = np.einsum("ij,ij->i", xyz, xyz)
    beyond = [np.count_nonzero(squared >= limit * limit) for limit in RANGES[:-1]]
    return -np.diff([*beyond, 0]) / len(xyz)


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


def _sample(xyz: Array) -> Array:
    """Some of the points, evenly, as an array of their own, so that the scan is not kept."""
    return xyz[:: max(1, len(xyz) // SAMPLE)].copy()
