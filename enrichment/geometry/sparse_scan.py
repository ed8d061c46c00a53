"""What a method of enrichment is given: a scan of few rings, and the image beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from enrichment.geometry import kernels
from enrichment.geometry.rays import MAX_COLUMNS, Prediction, RayGrid, range_image
from slam.data.cloud import Array, Calibration, History, PointCloud
from slam.data.sensor import Sensor

SAME = 1e-6  # m at 10 m: lines that differ by less are one
MAX_GAP = 2  # columns: a ring's return is taken from so near by where its own column has none


@dataclass(frozen=True, eq=False)
class SparseScan:
    """A scan as recorded, in the sensor's own geometry: neither deskewed nor vertically corrected.

    cloud        with ring ids
    lines        the laser line of every ring id
    rings        (K,) the ids that its sensor has, top first: a ring without any return counts, a dropped one does not
    read_image   gives `image`, (H, W, 3) uint8 RGB of the same moment, or None; it is read when a method asks for it
    calibration  the camera's, or None
    columns      W of the grids that it is asked for
    read_past    gives `past`: what the same rings saw before, newest last: clouds with rings, each with T_now_then
                 (4, 4); read when a method asks for it
    """

    cloud: PointCloud
    lines: Sensor
    rings: Array
    read_image: Callable[[], Array | None] = lambda: None
    calibration: Calibration | None = None
    columns: int = MAX_COLUMNS
    read_past: Callable[[], History] = tuple

    @cached_property
    def image(self) -> Array | None:
        """(H, W, 3) uint8 RGB."""
        return self.read_image()

    @cached_property
    def past(self) -> History:
        return self.read_past()

    @cached_property
    def points(self) -> Array:
        """(K, W) int32: the point of each ring and azimuth column, of the column itself or of one up to MAX_GAP
        away; -1 for none. Raises InputError where the points have no rings."""
        return np.asarray(
            kernels.filled(range_image(self.cloud, RayGrid(self.lines, self.columns))[self.rings], MAX_GAP)
        )

    def without(self, rings: Array) -> SparseScan:
        """The same scan as a sensor without these rings (M,) would have seen it."""
        kept = self.rings[~np.isin(self.rings, rings)]

        def past() -> History:
            return [(of_rings(then, kept), T_now_then) for then, T_now_then in self.past]

        return replace(self, cloud=of_rings(self.cloud, kept), rings=kept, read_past=past)

    def rows_above(self, sensor: Sensor) -> Array:
        """(R,) int64: which row of `points` is the next one above each of the sensor's lines, one with a row below it.

        -1 for a line above the first ring, below the last one, or that is a ring's own.
        """
        above, below = self.rows_around(sensor)
        return np.where(below == above + 1, above, -1)

    def rows_around(self, sensor: Sensor) -> tuple[Array, Array]:
        """(R,) int64 each: the rows of `points` next above and next below each of the sensor's lines, a ring on the
        line included; -1 where there is none."""
        lines, own = heights(sensor), heights(self.lines)[self.rings]
        above = np.searchsorted(-own, -lines + SAME, side="right") - 1
        below = np.searchsorted(-own, -lines - SAME, side="left")
        return above, np.where(below < len(own), below, -1)


def of_rings(cloud: PointCloud, rings: Array) -> PointCloud:
    """The points of these rings (M,) alone."""
    assert cloud.ring is not None
    return cloud.select(np.isin(cloud.ring, rings))


def heights(sensor: Sensor) -> Array:
    """(R,) float64, metres, of each laser line at 10 m: orders lines as the scene sees them."""
    return np.asarray(np.tan(sensor.elevation) * 10.0 + sensor.offset)


class Method(Protocol):
    """Predicts ranges on the rays of a grid of `scan.columns` columns; the scan's own rings may be left out."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction: ...
