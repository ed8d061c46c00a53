"""Interpolation without training: a ray meets the straight line between the returns above and below it.

Exact where the surface is a plane and the rays of a column lie in one vertical plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enrichment import kernels
from enrichment.rays import Prediction, RayGrid, range_image
from enrichment.sparse_scan import SparseScan
from slam.data.cloud import Array
from slam.data.sensor import Sensor

REACH = 2  # columns: a ring's return is taken from so near by where its own column has none
LEAST_SIGMA = 0.02  # m, on top of what grows with the segment
#: Sigma as a share of the segment's length. Collinear neighbours foretell a plane: measured on KITTI, the median error
#: is .03 of the length where the next segment goes on within 5 deg, and .2 to .35 where it turns by more than 20 deg.
STRAIGHT, BENT, TURN = 0.04, 0.29, np.deg2rad(20)
STEEP, STEEP_SHARE = np.deg2rad(60), 0.15
LONG, LONG_FACTOR = 8.0, 2.5  # m: from there on segments join an object's edge to what is behind


@dataclass(frozen=True, eq=False)
class Segments:
    """What each ray of a grid meets; all (R, W) float32, the first NaN where the ray is not between two returns.

    share   where on the segment: 0 at the return above, 1 at the one below
    length  of the segment, metres; slope and turn (against its neighbours), radians: see `kernels.ray_segments`
    image   (K, W) int32, the points of the rings that there are, gaps filled from REACH columns around
    upper   (R,) the row of `image` above each ray's line, -1 where there is none
    """

    share: Array
    length: Array
    slope: Array
    turn: Array
    image: Array
    upper: Array

    @property
    def sigma(self) -> Array:
        """(R, W) float32, metres."""
        part = STRAIGHT + BENT * np.minimum(self.turn / np.float32(TURN), 1)
        part = np.where(self.slope > STEEP, np.maximum(part, STEEP_SHARE), part)
        part = np.where(self.length > LONG, part * LONG_FACTOR, part)
        return np.asarray(LEAST_SIGMA + self.length * part, np.float32)


class RaySegment:
    """The method: a range wherever both returns are there."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        segments = meet(scan, grid)
        known = np.isfinite(segments.share)
        ranges = np.zeros(grid.shape, np.float32)
        row, column = np.nonzero(known)
        ranges[known] = grid.range_of(interpolated(scan.cloud.xyz, segments, row, column), row)
        return Prediction(ranges, np.where(known, segments.sigma, np.float32(np.inf)))


def meet(scan: SparseScan, grid: RayGrid) -> Segments:
    """The segments that the grid's rays meet. Raises InputError where the scan's points have no rings."""
    rings = scan.rings
    image = kernels.filled(range_image(scan.cloud, RayGrid(scan.lines, grid.columns))[rings], REACH)
    upper = rows_above(grid, scan)
    share, length, slope, turn = (np.zeros(grid.shape, np.float32) for _ in range(4))
    tangent = np.tan(grid.sensor.elevation)
    kernels.ray_segments(scan.cloud.xyz, image, upper, tangent, grid.sensor.offset, share, length, slope, turn)
    return Segments(share, length, slope, turn, image, upper)


def rows_above(grid: RayGrid, scan: SparseScan) -> Array:
    """(R,) int64: which of the scan's rings is the next one above each line of the grid; -1 for a line above the first,
    below the last, or that is a ring's own."""
    lines, own = _height(grid.sensor), _height(scan.lines)[scan.rings]
    above = np.searchsorted(-own, -lines, side="right") - 1
    on_ring = np.isclose(lines[:, None], own[None, :], atol=1e-9, rtol=0).any(axis=1)
    return np.where(on_ring | (above < 0) | (above >= len(own) - 1), -1, above)


def interpolated(values: Array, segments: Segments, row: Array, column: Array) -> Array:
    """Values (N, ...) of the scan's points at the rays (row, column), each (M,), by their shares of the segments."""
    k = segments.upper[row]
    share = segments.share[row, column].reshape(-1, *(1,) * (values.ndim - 1))
    above, below = values[segments.image[k, column]], values[segments.image[k + 1, column]]
    return np.asarray(above + share * (below - above))


def _height(sensor: Sensor) -> Array:
    """(R,) of each line at 10 m, which orders lines as the scene sees them."""
    return np.asarray(np.tan(sensor.elevation) * 10.0 + sensor.offset)
