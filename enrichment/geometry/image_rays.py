"""Conversion between rays and pixels: the depth image of a scan, and ranges of rays from a dense depth image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.camera import nearest_pixel, project, visible
from slam.data.cloud import Array, Calibration

START = 20.0  # m, initial range of the fixed-point iteration
ITERATIONS = 4  # the camera is near the LiDAR: each iteration reduces the error by ten and more
MARGIN = 40  # pixels outside the image at START: such a ray may still enter the image at shorter ranges


@dataclass(frozen=True, eq=False)
class ImageRays:
    """M rays of a grid in front of a camera.

    Attributes:
        row: (M,) row in the grid.
        column: (M,) column in the grid.
        origin: (M, 3) origin of each ray [m].
        direction: (M, 3) direction; points are at origin + range * direction.
        calibration: Calibration of the camera.
    """

    row: Array
    column: Array
    origin: Array
    direction: Array
    calibration: Calibration

    def select(self, mask: Array) -> ImageRays:
        """Return the rays selected by a mask (M,)."""
        arrays = self.row[mask], self.column[mask], self.origin[mask], self.direction[mask]
        return ImageRays(*arrays, self.calibration)

    def pixels(self, ranges: Array) -> Array:
        """Return the pixels (M, 2) float64 of the rays at ranges (M,) [m], u and v as in `slam.data.camera.project`."""
        return self._project(ranges)[0]

    def intersect(self, dense: Array) -> Array:
        """Intersect the rays with a dense depth image.

        A fixed-point iteration over the range: the depth at the pixel of the current point, bilinear in inverse depth,
        gives the next point. During the iteration the pixel may be outside the image, where the nearest pixel counts,
        but not at the end.

        Args:
            dense: Depth image (H, W) [m], 0 for none.

        Returns:
            (M,) float64 ranges along the rays [m], NaN without an intersection.
        """
        inverse = np.divide(1, dense, out=np.full(dense.shape, np.nan), where=dense > 0)
        nearest, further = (self._project(np.full(len(self.row), ranges))[1] for ranges in (0.0, 1.0))
        stretch = 1 / (further - nearest)  # depth is linear in range
        ranges = np.full(len(self.row), START)
        for _ in range(ITERATIONS):
            depth = 1 / map_coordinates(inverse, self.pixels(ranges).T[::-1], order=1, mode="nearest")
            ranges = np.where(np.isfinite(depth), (depth - nearest) * stretch, ranges)
        inside = within(self.pixels(ranges), dense.shape)
        return np.where(inside & np.isfinite(depth) & (ranges > 0), ranges, np.nan)

    def _project(self, ranges: Array) -> tuple[Array, Array]:
        return project(self.origin + ranges[:, None] * self.direction, self.calibration)


def rays_before_camera(grid: RayGrid, wanted: Array, calibration: Calibration, shape: tuple[int, ...]) -> ImageRays:
    """Select the rays, among those `wanted` (R, W) bool, that may be visible in an image of `shape` (H, W, ...)."""
    row, column = np.nonzero(wanted)
    origin = grid.points(np.zeros(len(row)), row, column)
    rays = ImageRays(row, column, origin, grid.points(np.ones(len(row)), row, column) - origin, calibration)
    return rays.select(within(rays.pixels(np.full(len(row), START)), shape, MARGIN))


def within(pixels: Array, shape: tuple[int, ...], margin: float = 0.0) -> Array:
    """Check which pixels (N, 2) are inside an image of `shape` (H, W, ...) with a margin [pixels]; NaN are not."""
    low, high = -0.5 - margin, np.array(shape[1::-1]) - 0.5 + margin
    return np.asarray(((pixels >= low) & (pixels < high)).all(axis=1))


@dataclass(frozen=True, eq=False)
class ProjectedPoints:
    """The N points of a scan, projected into the image.

    Attributes:
        pixels: (N, 2) float64, from `slam.data.camera.project`.
        shown: (N,) bool, inside the image and not occluded.
        image: (H, W) float32, depth of the nearest shown point in each pixel [m], 0 for none.
    """

    pixels: Array
    shown: Array
    image: Array


def project_scan(scan: SparseScan) -> ProjectedPoints:
    """Project the points of a scan, which must have an image and a calibration, into the image."""
    assert scan.image is not None
    assert scan.calibration is not None
    pixels, depth = project(scan.cloud.xyz, scan.calibration)
    shown = visible(pixels, depth, scan.image.shape)
    u, v = nearest_pixel(pixels[shown])
    image = np.full(scan.image.shape[:2], np.inf, np.float32)
    np.minimum.at(image, (v, u), depth[shown].astype(np.float32))
    image[np.isinf(image)] = 0
    return ProjectedPoints(pixels, shown, image)


def between_returns(scan: SparseScan, grid: RayGrid) -> Array:
    """Select the rays (R, W) with a return both above and below in `scan.points`; without one there is mostly sky."""
    upper, known = scan.rows_above(grid.sensor), scan.points >= 0
    return (upper >= 0)[:, None] & known[upper] & known[np.minimum(upper + 1, len(known) - 1)]
