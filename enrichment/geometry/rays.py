"""Virtual rays on which ranges are predicted: laser lines x azimuth columns.

A ray is the calibrated line of its laser at the centre of its column, never the direction of a measured return: HDL-64
lasers are above the sensor's origin, so the exact elevation of a return would reveal its range.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enrichment.geometry import kernels
from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.data.sensor import Sensor

MAX_COLUMNS = 2000  # of 0.18 deg: the HDL-64E fires every 0.17 deg at 10 Hz
MIN_COLUMNS = 360


@dataclass(frozen=True, eq=False)
class RayGrid:
    """Grid of R laser lines x W columns; column c begins at the azimuth -pi + 2 pi c / W.

    The range of a point on a ray is measured along the ray from the sensor's vertical axis: rho / cos(elevation), with
    rho = hypot(x, y).

    Attributes:
        sensor: The R laser lines.
        columns: Number of columns W.
        azimuth: (W,) float64, azimuth of the columns' centres [rad].
    """

    sensor: Sensor
    columns: int = MAX_COLUMNS
    azimuth: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "azimuth", ((np.arange(self.columns) + 0.5) / self.columns - 0.5) * 2 * np.pi)

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (R, W)."""
        return self.sensor.ring_count, self.columns

    def column_of(self, xyz: Array) -> Array:
        """Return the column (N,) int64 of each point (N, 3)."""
        return np.asarray(kernels.columns_of(xyz, self.columns))

    def range_of(self, xyz: Array, ring: Array) -> Array:
        """Return the range (N,) float64 [m] of points (N, 3) along the line of their ring (N,)."""
        return np.asarray(np.hypot(xyz[:, 0], xyz[:, 1], dtype=float) / np.cos(self.sensor.elevation[ring]))

    def points(self, ranges: Array, ring: Array, column: Array) -> Array:
        """Return the points (N, 3) float32 on the rays (ring, column), each (N,), at ranges (N,) [m]."""
        rho = ranges * np.cos(self.sensor.elevation[ring])
        azimuth = self.azimuth[column]
        z = ranges * np.sin(self.sensor.elevation[ring]) + self.sensor.offset[ring]
        return np.column_stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted ranges on the rays of a grid.

    Attributes:
        ranges: (R, W) float32 [m], 0 where nothing is predicted.
        sigma: (R, W) float32 [m], half the width of the central 68 % interval of the error; infinite where unknown.
        trusted: (R, W) bool, accurate enough for registration.
    """

    ranges: Array
    sigma: Array
    trusted: Array

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> Prediction:
        """Create a prediction without any range, for a grid of this shape."""
        return cls(np.zeros(shape, np.float32), np.full(shape, np.inf, np.float32), np.zeros(shape, bool))


def columns_for(cloud: PointCloud) -> int:
    """Return the number of columns that a scan fills, from the median azimuth step of the ring with the most points."""
    if cloud.ring is None or len(cloud) == 0:
        return MAX_COLUMNS
    fullest = cloud.xyz[cloud.ring == np.bincount(cloud.ring).argmax()]
    steps = np.diff(np.sort(np.arctan2(fullest[:, 1], fullest[:, 0])))
    steps = steps[steps > 0]
    if len(steps) == 0:
        return MAX_COLUMNS
    return int(np.clip(round(2 * np.pi / np.median(steps)), MIN_COLUMNS, MAX_COLUMNS))


def range_image(cloud: PointCloud, grid: RayGrid) -> Array:
    """Compute the range image of a cloud: the index of its nearest point on each ray, (R, W) int32, -1 for none.

    Points are assigned by ring index, never by elevation.

    Raises:
        InputError: The points have no ring indices, or a ring does not exist in the sensor.
    """
    if cloud.ring is None:
        raise InputError(
            "the range image needs ring indices, and the sensor model is unknown; name the LiDAR with --sensor"
        )
    if len(cloud) and not 0 <= int(cloud.ring.min()) <= int(cloud.ring.max()) < grid.sensor.ring_count:
        raise InputError(
            f"ring {cloud.ring.max()} in a scan, but {grid.sensor.name} has {grid.sensor.ring_count}; "
            "name the right LiDAR with --sensor"
        )
    return np.asarray(kernels.range_image(cloud.xyz, cloud.ring, grid.sensor.ring_count, grid.columns))
