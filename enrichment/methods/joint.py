"""Ray segments and the image together: where a segment may be a false sheet, the image helps to choose a surface.

The ray-segment's own sigma says where: on one ray in eight, which have most of the error. There the range is a
weighted median of what returns near by in the image have, each weighing the more the more alike its colour, and of two
guesses: IP-Basic's depth image, and how far the colours have changed on the way between the returns above and below.
A median chooses; a mean would put points between the surfaces.

Lift's candidate GUESS (`enrichment.lift.kernels.guess`) is the same idea with the same weights, in a compiled loop. The
two stay apart, for they do not give the same ranges: that one samples colours half as often and completes the depth
image at half its resolution, to take milliseconds, and the shipped weights were trained with it.
"""

from __future__ import annotations

import cv2
import numpy as np

from enrichment.geometry.image_rays import ImageRays, rays_before_camera, see, within
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.depth_completion import ip_basic, sure
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.lift.features import BLUR
from enrichment.lift.kernels import APART, BESIDE, COLOUR, COLUMNS_NEAR, RETURNS, RINGS_NEAR, UNSURE_SEGMENT, UP
from slam.data.camera import nearest_pixel
from slam.data.cloud import Array

PATH_SAMPLES = 24  # pixels looked at on each half of the way between the returns above and below
LEAST_SIGMA, SPREAD_SHARE = 0.02, 0.7  # m; of the mean distance of the guesses from their median, measured on KITTI


class Joint:
    """The method: ray-segment, and what the image says where the segment is unsure. Without an image, ray-segment."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        plain = RaySegment()(scan, grid)
        if scan.image is None or scan.calibration is None:
            return plain
        unsure = (plain.ranges > 0) & (plain.sigma > UNSURE_SEGMENT)
        rays = rays_before_camera(grid, unsure, scan.calibration, scan.image.shape)
        rays = rays.select(within(rays.pixels(plain.ranges[rays.row, rays.column]), scan.image.shape))
        if len(rays.row) == 0:
            return plain
        ray = rays.row, rays.column
        guesses, weights = _guesses(scan, grid, rays, plain.ranges[ray])
        median = weighted_median(guesses, weights)
        spread = np.average(np.abs(guesses - median[:, None]), axis=1, weights=weights)
        ranges, sigma, trusted = plain.ranges.copy(), plain.sigma.copy(), plain.trusted.copy()
        ranges[ray], sigma[ray] = median, LEAST_SIGMA + SPREAD_SHARE * spread
        trusted[ray] |= sure(median, sigma[ray])
        return Prediction(ranges, sigma, trusted)


def _guesses(scan: SparseScan, grid: RayGrid, rays: ImageRays, plain: Array) -> tuple[Array, Array]:
    """Ranges (M, G) [m] that the rays may have, and the weights (M, G) of these; `plain` (M,) are the segments'.

    A ray's pixel is the one at its segment's range: one for each guess, where the ray is at that range, measured worse.
    """
    assert scan.image is not None
    seen, image = see(scan), cv2.GaussianBlur(scan.image, (0, 0), BLUR)
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
    """(M, G) points of the scan around the rays (M,) below the rings `upper`; -1 for none."""
    near_rings, near_columns = np.arange(*RINGS_NEAR), np.arange(-COLUMNS_NEAR, COLUMNS_NEAR + 1, APART)
    rings, columns = upper[:, None, None] + near_rings[:, None], column[:, None, None] + near_columns
    count, around = scan.points.shape
    points = scan.points[np.clip(rings, 0, count - 1), columns % around]
    return np.where((rings >= 0) & (rings < count), points, -1).reshape(len(upper), -1)


def _likeness(image: Array, here: Array, there: Array) -> Array:
    """(M, G) weights, 0..1, of pixels `there` (M, G, 2) to those `here` (M, 2), by distance and colour."""
    aside, up = np.moveaxis(np.abs(there - here[:, None]), -1, 0)
    colour = np.linalg.norm(_colours(image, there) - _colours(image, here)[:, None], axis=-1)
    return np.nan_to_num(np.exp(-aside / BESIDE - up / UP - colour / COLOUR))


def _share_of_change(image: Array, above: Array, here: Array, below: Array) -> Array:
    """(M,) in 0..1: how much of the change of colour on the way above - here - below, pixels (M, 2), lies above."""
    first, second = _change(image, above, here), _change(image, here, below)
    return (first + 1e-3) / (first + second + 2e-3)


def _change(image: Array, start: Array, stop: Array) -> Array:
    """(M,) the length of the way through colours on the straight way from pixel to pixel, (M, 2) each."""
    steps = np.linspace(0, 1, PATH_SAMPLES)[:, None]
    colours = _colours(image, start[:, None] + steps * (stop - start)[:, None])
    return np.asarray(np.linalg.norm(np.diff(colours, axis=1), axis=-1).sum(axis=1))


def _colours(image: Array, pixels: Array) -> Array:
    """(..., 3) float32 at pixels (..., 2); outside, those of the nearest pixel."""
    height, width = image.shape[:2]
    u, v = nearest_pixel(np.clip(np.nan_to_num(pixels), 0, (width - 1, height - 1)))
    return image[v, u].astype(np.float32)


def weighted_median(values: Array, weights: Array) -> Array:
    """(M,): of each row of values (M, G) the least one that has half of the weights (M, G) up to it."""
    order = np.argsort(values, axis=1)
    reached = np.cumsum(np.take_along_axis(weights, order, axis=1), axis=1)
    middle = (reached >= reached[:, -1:] / 2).argmax(axis=1)
    return np.asarray(values[np.arange(len(values)), order[np.arange(len(values)), middle]])
