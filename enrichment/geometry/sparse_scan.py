"""Input of an enrichment method: a scan with few rings, and the image of the same moment."""

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

SAME = 1e-6  # m at 10 m: lines that differ by less are identical
MAX_GAP = 2  # columns: an empty column takes the return of a column at most this far away


@dataclass(frozen=True, eq=False)
class SparseScan:
    """A scan as recorded, in sensor geometry: neither deskewed nor vertically corrected.

    Attributes:
        cloud: The points, with ring indices.
        lines: Laser lines by ring index.
        rings: (K,) ring indices of the sparse sensor, top first; rings without returns are included, dropped ones not.
        read_image: Returns the image, (H, W, 3) uint8 RGB of the same moment, or None; called when it is needed.
        calibration: Calibration of the camera, or None.
        columns: Columns W of the grids used with this scan.
        read_past: Returns earlier scans of the same rings, newest last, each with T_now_then (4, 4); called when they
            are needed.
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
        """Image (H, W, 3) uint8 RGB, or None."""
        return self.read_image()

    @cached_property
    def past(self) -> History:
        """Earlier scans of the same rings, newest last, each with T_now_then (4, 4)."""
        return self.read_past()

    @cached_property
    def points(self) -> Array:
        """Point of each ring and azimuth column, or of a column up to MAX_GAP away, (K, W) int32; -1 for none.

        Raises:
            InputError: The points have no ring indices.
        """
        return np.asarray(
            kernels.filled(range_image(self.cloud, RayGrid(self.lines, self.columns))[self.rings], MAX_GAP)
        )

    def without(self, rings: Array) -> SparseScan:
        """Return the scan without these rings (M,)."""
        kept = self.rings[~np.isin(self.rings, rings)]

        def past() -> History:
            return [(select_rings(then, kept), T_now_then) for then, T_now_then in self.past]

        return replace(self, cloud=select_rings(self.cloud, kept), rings=kept, read_past=past)

    def rows_above(self, sensor: Sensor) -> Array:
        """Return the row of `points` above each line of a sensor, (R,) int64; the next row is below the line.

        The result is -1 for lines above the first ring, below the last one, or identical to a ring's.
        """
        above, below = self.rows_around(sensor)
        return np.where(below == above + 1, above, -1)

    def rows_around(self, sensor: Sensor) -> tuple[Array, Array]:
        """Return the rows of `points` next above and next below each line of a sensor, (R,) int64 each.

        A ring on the line itself counts as both; -1 if there is none.
        """
        lines, own = heights(sensor), heights(self.lines)[self.rings]
        above = np.searchsorted(-own, -lines + SAME, side="right") - 1
        below = np.searchsorted(-own, -lines - SAME, side="left")
        return above, np.where(below < len(own), below, -1)


def select_rings(cloud: PointCloud, rings: Array) -> PointCloud:
    """Return the points of these rings (M,)."""
    assert cloud.ring is not None
    return cloud.select(np.isin(cloud.ring, rings))


def heights(sensor: Sensor) -> Array:
    """Return the height (R,) float64 [m] of each laser line at a distance of 10 m, which orders lines."""
    return np.asarray(np.tan(sensor.elevation) * 10.0 + sensor.offset)


class Method(Protocol):
    """An enrichment method."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        """Predict ranges on the rays of a grid of `scan.columns` columns; the scan's own rings may be left out."""
        ...
