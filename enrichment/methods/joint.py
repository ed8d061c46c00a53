"""Ray segments guided by the image: where a segment is uncertain, the image helps to choose between surfaces.

Uncertain are the rays whose ray-segment sigma is large: one ray in eight, with most of the error. Their range is a
weighted median of the ranges of returns nearby in the image, weighted by similarity of colour, and of two guesses: the
depth image completed by IP-Basic, and the position of the colour change between the returns above and below. A median
chooses one surface; a mean would put points between surfaces.

Lift's candidate GUESS (`enrichment.lift.kernels.guess`) uses the same idea and weights in a compiled kernel. The two
are separate because their ranges differ: the kernel samples colours half as often and completes the depth image at half
its resolution, to take milliseconds, and the shipped weights were trained with it.
"""

from __future__ import annotations

import cv2
import numpy as np

from enrichment.geometry.image_rays import ImageRays, project_scan, rays_before_camera, within
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.depth_completion import ip_basic, is_trusted
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.lift.features import BLUR
from enrichment.lift.kernels import (
    COLOUR,
    COLUMN_STEP,
    COLUMNS_NEAR,
    HORIZONTAL,
    RETURNS,
    RINGS_NEAR,
    UNCERTAIN_SIGMA,
    VERTICAL,
)
from slam.data.camera import nearest_pixel
from slam.data.cloud import Array

PATH_SAMPLES = 24  # pixels sampled on each half of the line between the returns above and below
MIN_SIGMA, SPREAD_SHARE = 0.02, 0.7  # m; share of the guesses' mean distance from their median, measured on KITTI


class Joint:
    """Enrichment method: ray-segment, with the image where the segment is uncertain; without an image, ray-segment."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        """Predict ranges between the rings."""
        plain = RaySegment()(scan, grid)
        if scan.image is None or scan.calibration is None:
            return plain
        uncertain = (plain.ranges > 0) & (plain.sigma > UNCERTAIN_SIGMA)
        rays = rays_before_camera(grid, uncertain, scan.calibration, scan.image.shape)
        rays = rays.select(within(rays.pixels(plain.ranges[rays.row, rays.column]), scan.image.shape))
        if len(rays.row) == 0:
            return plain
        ray = rays.row, rays.column
        guesses, weights = _guesses(scan, grid, rays, plain.ranges[ray])
        median = weighted_median(guesses, weights)
        spread = np.average(np.abs(guesses - median[:, None]), axis=1, weights=weights)
        ranges, sigma, trusted = plain.ranges.copy(), plain.sigma.copy(), plain.trusted.copy()
        ranges[ray], sigma[ray] = median, MIN_SIGMA + SPREAD_SHARE * spread
        trusted[ray] |= is_trusted(median, sigma[ray])
        return Prediction(ranges, sigma, trusted)


def _guesses(scan: SparseScan, grid: RayGrid, rays: ImageRays, plain: Array) -> tuple[Array, Array]:
    """Possible ranges (M, G) [m] of the rays and their weights (M, G); `plain` (M,) are the ranges of the segments.

    The pixel of a ray is that at the range of its segment; a separate pixel for each guess was measured to be worse.
    """
    assert scan.image is not None
    seen, image = project_scan(scan), cv2.GaussianBlur(scan.image, (0, 0), BLUR)
    upper, here = scan.rows_above(grid.sensor)[rays.row], rays.pixels(plain)
    above, below = scan.points[upper, rays.column], scan.points[upper + 1, rays.column]

    near = _near(scan, upper, rays.column)
    weights = _likeness(image, here, seen.pixels[near]) * (seen.shown[near] & (near >= 0))
    weights *= RETURNS / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)

    rho = np.hypot(scan.cloud.xyz[:, 0], scan.cloud.xyz[:, 1])
    share = _share_of_change(image, seen.pixels[above], here, seen.pixels[below])
    edge = 1 / ((1 - share) / rho[above] + share / rho[below])
    ranges = np.column_stack([rho[near], edge]) / np.cos(grid.sensor.elevation[rays.row])[:, None]
    dense = rays.intersect(ip_basic(seen.image, scan.image))
    dense = np.where(np.isfinite(dense), dense, plain)
    return np.column_stack([ranges, dense]), np.column_stack([weights, np.ones((len(weights), 2))])


def _near(scan: SparseScan, upper: Array, column: Array) -> Array:
    """Points of the scan (M, G) around the rays (M,) below the rings `upper`; -1 for none."""
    near_rings, near_columns = np.arange(*RINGS_NEAR), np.arange(-COLUMNS_NEAR, COLUMNS_NEAR + 1, COLUMN_STEP)
    rings, columns = upper[:, None, None] + near_rings[:, None], column[:, None, None] + near_columns
    count, around = scan.points.shape
    points = scan.points[np.clip(rings, 0, count - 1), columns % around]
    return np.where((rings >= 0) & (rings < count), points, -1).reshape(len(upper), -1)


def _likeness(image: Array, here: Array, there: Array) -> Array:
    """Weights (M, G), 0..1, of pixels `there` (M, G, 2) relative to `here` (M, 2), by distance and colour."""
    horizontal, vertical = np.moveaxis(np.abs(there - here[:, None]), -1, 0)
    colour = np.linalg.norm(_colours(image, there) - _colours(image, here)[:, None], axis=-1)
    return np.nan_to_num(np.exp(-horizontal / HORIZONTAL - vertical / VERTICAL - colour / COLOUR))


def _share_of_change(image: Array, above: Array, here: Array, below: Array) -> Array:
    """Share (M,), 0..1, of the colour change along the line above - here - below, pixels (M, 2), before `here`."""
    first, second = _change(image, above, here), _change(image, here, below)
    return (first + 1e-3) / (first + second + 2e-3)


def _change(image: Array, start: Array, stop: Array) -> Array:
    """Total colour change (M,) along the straight line between two pixels, (M, 2) each."""
    steps = np.linspace(0, 1, PATH_SAMPLES)[:, None]
    colours = _colours(image, start[:, None] + steps * (stop - start)[:, None])
    return np.asarray(np.linalg.norm(np.diff(colours, axis=1), axis=-1).sum(axis=1))


def _colours(image: Array, pixels: Array) -> Array:
    """Colours (..., 3) float32 at pixels (..., 2); outside the image those of the nearest pixel."""
    height, width = image.shape[:2]
    u, v = nearest_pixel(np.clip(np.nan_to_num(pixels), 0, (width - 1, height - 1)))
    return image[v, u].astype(np.float32)


def weighted_median(values: Array, weights: Array) -> Array:
    """Compute the weighted median (M,) of each row of values (M, G), the smallest one that reaches half the weight."""
    order = np.argsort(values, axis=1)
    reached = np.cumsum(np.take_along_axis(weights, order, axis=1), axis=1)
    middle = (reached >= reached[:, -1:] / 2).argmax(axis=1)
    return np.asarray(values[np.arange(len(values)), order[np.arange(len(values)), middle]])
