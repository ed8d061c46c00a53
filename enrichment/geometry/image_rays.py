"""Between rays and pixels: the depth image that a scan gives, and the ranges that rays read from a dense one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.camera import nearest_pixel, project, visible
from slam.data.cloud import Array, Calibration

START = 20.0  # m, along the ray: where looking for its depth begins
ITERATIONS = 4  # the camera is near the LiDAR: a step divides what is left to go by ten and more
MARGIN = 40  # pixels outside the image at START: from there, a ray may still enter it nearer by


@dataclass(frozen=True, eq=False)
class ImageRays:
    """M rays of a grid before a camera: row (M,) and column (M,), at origin + range * direction, (M, 3) each."""

    row: Array
    column: Array
    origin: Array
    direction: Array
    calibration: Calibration

    def select(self, mask: Array) -> ImageRays:
        """Those that a mask (M,) picks."""
        arrays = self.row[mask], self.column[mask], self.origin[mask], self.direction[mask]
        return ImageRays(*arrays, self.calibration)

    def pixels(self, ranges: Array) -> Array:
        """(M, 2) float64, u and v as in `slam.data.camera.project`: where the rays are at these ranges (M,) [m]."""
        return self._project(ranges)[0]

    def intersect(self, dense: Array) -> Array:
        """(M,) float64, metres along the ray to where it meets a dense depth image (H, W) [m, 0 = none]; NaN: nowhere.

        A fixed point over the range: the depth at the pixel of the ray's point, bilinear in inverse depth, gives the
        next point. The pixel may lie outside the image on the way, where the nearest pixel counts, but not at the end.
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
    """The rays among those `wanted`, (R, W) bool, that an image of `shape` (H, W, ...) may see."""
    row, column = np.nonzero(wanted)
    origin = grid.points(np.zeros(len(row)), row, column)
    rays = ImageRays(row, column, origin, grid.points(np.ones(len(row)), row, column) - origin, calibration)
    return rays.select(within(rays.pixels(np.full(len(row), START)), shape, MARGIN))


def within(pixels: Array, shape: tuple[int, ...], margin: float = 0.0) -> Array:
    """(N,) bool: which pixels (N, 2) lie in an image of `shape` (H, W, ...), or so many pixels outside; NaN do not."""
    low, high = -0.5 - margin, np.array(shape[1::-1]) - 0.5 + margin
    return np.asarray(((pixels >= low) & (pixels < high)).all(axis=1))


@dataclass(frozen=True, eq=False)
class SeenPoints:
    """The points of a scan, N of them, as the camera has them.

    pixels  (N, 2) float64, of `slam.data.camera.project`
    shown   (N,) bool: inside the image and not hidden
    image   (H, W) float32, metres: the depth of the nearest shown point in each pixel, 0 = none
    """

    pixels: Array
    shown: Array
    image: Array


def see(scan: SparseScan) -> SeenPoints:
    """The points of a scan that has an image and a calibration."""
    assert scan.image is not None
    assert scan.calibration is not None
    pixels, depth = project(scan.cloud.xyz, scan.calibration)
    shown = visible(pixels, depth, scan.image.shape)
    u, v = nearest_pixel(pixels[shown])
    image = np.full(scan.image.shape[:2], np.inf, np.float32)
    np.minimum.at(image, (v, u), depth[shown].astype(np.float32))
    image[np.isinf(image)] = 0
    return SeenPoints(pixels, shown, image)


def between_returns(scan: SparseScan, grid: RayGrid) -> Array:
    """(R, W) bool: the rays with a return of the scan both above and below, as `scan.points` has them. Where one is
    missing there is mostly sky."""
    upper, known = scan.rows_above(grid.sensor), scan.points >= 0
    return (upper >= 0)[:, None] & known[upper] & known[np.minimum(upper + 1, len(known) - 1)]
