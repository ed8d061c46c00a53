"""The rays that ranges are predicted on: laser lines times azimuth columns.

A ray is the calibrated line of its laser at the centre of its column, never the direction in which a return was found:
HDL-64 lasers sit above the sensor's origin, so a return's exact elevation gives its range away.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enrichment.geometry import kernels
from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.data.sensor import Sensor

MAX_COLUMNS = 2000  # 0.18 deg each: the HDL-64E fires every 0.17 deg at 10 Hz
MIN_COLUMNS = 360


@dataclass(frozen=True, eq=False)
class RayGrid:
    """R laser lines times W columns; column c spans azimuths -pi + 2 pi c / W to the next one's.

    The range of a point on a ray is measured along the ray from the sensor's vertical axis: rho / cos(elevation), with
    rho = hypot(x, y).
    """

    sensor: Sensor
    columns: int = MAX_COLUMNS
    azimuth: Array = field(init=False, repr=False)  # (W,) float64, radians, of the columns' centres

    def __post_init__(self) -> None:
        object.__setattr__(self, "azimuth", ((np.arange(self.columns) + 0.5) / self.columns - 0.5) * 2 * np.pi)

    @property
    def shape(self) -> tuple[int, int]:
        """(R, W)."""
        return self.sensor.ring_count, self.columns

    def column_of(self, xyz: Array) -> Array:
        """(N,) int64: the column that each point (N, 3) lies in."""
        return np.asarray(kernels.columns_of(xyz, self.columns))

    def range_of(self, xyz: Array, ring: Array) -> Array:
        """(N,) float64, metres: range along the ray, as if each point (N, 3) lay on the line of its ring (N,)."""
        return np.asarray(np.hypot(xyz[:, 0], xyz[:, 1], dtype=float) / np.cos(self.sensor.elevation[ring]))

    def points(self, ranges: Array, ring: Array, column: Array) -> Array:
        """(N, 3) float32: where the rays (ring, column), each (N,), are at these ranges (N,) [m]."""
        rho = ranges * np.cos(self.sensor.elevation[ring])
        azimuth = self.azimuth[column]
        z = ranges * np.sin(self.sensor.elevation[ring]) + self.sensor.offset[ring]
        return np.column_stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Ranges on the rays of a grid.

    ranges   (R, W) float32, metres; 0 where nothing is predicted
    sigma    (R, W) float32, metres: half the width of the central 68 % interval of the error; infinite where unknown
    trusted  (R, W) bool: those worth registering
    """

    ranges: Array
    sigma: Array
    trusted: Array


def columns_for(cloud: PointCloud) -> int:
    """How many columns a scan fills, MAX_COLUMNS at most: a turn by the usual step of azimuth on its fullest ring."""
    if cloud.ring is None or len(cloud) == 0:
        return MAX_COLUMNS
    fullest = cloud.xyz[cloud.ring == np.bincount(cloud.ring).argmax()]
    steps = np.diff(np.sort(np.arctan2(fullest[:, 1], fullest[:, 0])))
    steps = steps[steps > 0]
    if len(steps) == 0:
        return MAX_COLUMNS
    return int(np.clip(round(2 * np.pi / np.median(steps)), MIN_COLUMNS, MAX_COLUMNS))


def range_image(cloud: PointCloud, grid: RayGrid) -> Array:
    """(R, W) int32: which of the cloud's points each ray meets, -1 for none. Raises InputError without rings.

    By ring id, never by elevation. Where two points of a ring share a column, the nearer one counts; so where none do,
    the points and their image tell the same.
    """
    if cloud.ring is None:
        raise InputError("no range image, for nobody knows which laser the points came from; name the LiDAR: --sensor")
    if len(cloud) and not 0 <= int(cloud.ring.min()) <= int(cloud.ring.max()) < grid.sensor.ring_count:
        raise InputError(f"ring {cloud.ring.max()} in a scan, but {grid.sensor.name} has {grid.sensor.ring_count}")
    return np.asarray(kernels.range_image(cloud.xyz, cloud.ring, grid.sensor.ring_count, grid.columns))
