"""Depth completion without training, and enrichment methods based on it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import cg
from scipy.spatial import Delaunay, QhullError

from enrichment.geometry.image_rays import ImageRays, between_returns, project_scan, rays_before_camera
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.camera import nearest_pixel
from slam.data.cloud import Array

#: Kernel sizes of IP-Basic [pixels], the first (H, W): 16 rings are some 20 rows apart, so it is tall; 5 for 64 rings.
TALL, CLOSE, FILL, LARGE_FILL, BLUR = (21, 5), 9, 9, 31, 5
MIN_INVERTED = 20.0  # m, lower bound of inverted depths

#: Markov random field: side of the cells [pixels]; decay of the smoothness weight with the squared difference of
#: neighbouring colours (0..1 each), and its minimum; weight of a return relative to a neighbour of the same colour.
CELL, EDGE, MIN_SMOOTHNESS, DATA = 2, 30.0, 0.01, 10.0
TOLERANCE, ITERATIONS = 1e-4, 500  # relative residual and iterations at which conjugate gradients stop

#: Sigma is a share of the spread of depth in a window (H, W) that extends beyond the adjacent rings. Measured on KITTI
#: with 16 of 64 rings; methods that interpolate planes have smaller shares.
WINDOW, MIN_SIGMA = (41, 13), 0.05
NEAREST_SPREAD, IP_BASIC_SPREAD, DELAUNAY_SPREAD, MRF_SPREAD = 0.19, 0.19, 0.035, 0.1
TRUSTED_SIGMA, TRUSTED_SHARE = 0.1, 0.02  # m, and share of the range


def nearest_sample(sparse: Array, _image: Array) -> Array:
    """Complete depth (H, W) with the depth of the nearest pixel that has one."""
    if not sparse.any():
        return sparse
    index = distance_transform_edt(sparse == 0, return_distances=False, return_indices=True)
    return np.asarray(sparse[tuple(index)])


def ip_basic(sparse: Array, _image: Array) -> Array:
    """Complete depth (H, W) by IP-Basic: morphology on inverted depth, in which nearer surfaces dominate.

    Ku, Harakeh, Waslander, "In Defense of Classical Image Processing", CRV 2018, here with a tall first kernel. The top
    of the image is not extrapolated from the topmost depths: it is sky.
    """
    return scaled_ip_basic(sparse, 1.0)


def scaled_ip_basic(sparse: Array, scale: float) -> Array:
    """Complete depth by `ip_basic` with kernels for images of `scale` cells per pixel."""
    if not sparse.any():
        return sparse
    tall, aside, close, fill, large, blur = (
        max(2 * round((size * scale - 1) / 2) + 1, 3) for size in (*TALL, CLOSE, FILL, LARGE_FILL, BLUR)
    )
    far = np.float32(sparse.max() + MIN_INVERTED)
    inverted = np.where(sparse > 0, far - sparse, np.float32(0))
    inverted = cv2.dilate(inverted, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (aside, tall)))
    inverted = cv2.morphologyEx(inverted, cv2.MORPH_CLOSE, np.ones((close, close), np.uint8))
    for size in (fill, large):
        inverted = np.where(inverted > 0, inverted, cv2.dilate(inverted, np.ones((size, size), np.uint8)))
    inverted = cv2.medianBlur(inverted, blur)
    known = inverted > 0
    share = cv2.GaussianBlur(known.astype(np.float32), (blur, blur), 0)  # weight of known depths in the blur
    return np.where(known, far - cv2.GaussianBlur(inverted, (blur, blur), 0) / np.maximum(share, 1e-6), np.float32(0))


def delaunay(sparse: Array, _image: Array) -> Array:
    """Complete depth (H, W) linearly in inverse depth on Delaunay triangles: exact on planes, none outside the hull."""
    v, u = np.nonzero(sparse)
    try:
        triangles = Delaunay(np.column_stack([u, v]))
    except (QhullError, ValueError):  # fewer than three, or all in a line
        return np.zeros_like(sparse)
    inverse = LinearNDInterpolator(triangles, 1 / sparse[v, u].astype(float), fill_value=np.inf)
    rows, columns = np.indices(sparse.shape)
    return np.asarray(1 / inverse(columns, rows), np.float32)


def markov_random_field(sparse: Array, image: Array) -> Array:
    """Complete depth (H, W) by a Markov random field on inverse depth, guided by the image (H, W, 3).

    Minimises sum DATA (x - sample)^2 + sum w_ij (x_i - x_j)^2 over neighbours, w = exp(-EDGE |colour_i - colour_j|^2),
    by conjugate gradients (Diebel & Thrun, NIPS 2005, there in depth), on cells of CELL x CELL pixels.
    """
    if not sparse.any():
        return sparse
    height, width = (-(-size // CELL) for size in sparse.shape)
    v, u = np.nonzero(sparse)
    cell = (v // CELL) * width + u // CELL
    weight = DATA * np.bincount(cell, minlength=height * width)
    data = DATA * np.bincount(cell, 1 / sparse[v, u].astype(float), height * width)
    smoothness = _smoothness(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))
    start = 1 / nearest_sample(sparse, image)[::CELL, ::CELL].ravel().astype(float)
    system = (diags_array(weight) + smoothness).tocsr()
    x, _ = cg(system, data, start, rtol=TOLERANCE, maxiter=ITERATIONS, M=diags_array(1 / system.diagonal()))
    inverse = cv2.resize(x.reshape(height, width), None, fx=CELL, fy=CELL, interpolation=cv2.INTER_LINEAR)
    return np.asarray(1 / inverse[: sparse.shape[0], : sparse.shape[1]], np.float32)


def _smoothness(image: Array) -> coo_array:
    """Weighted graph Laplacian (H W, H W) of the neighbouring pixels of an image (H, W, 3)."""
    number = np.arange(image[..., 0].size).reshape(image.shape[:2])
    first = np.concatenate([number[:, :-1].ravel(), number[:-1].ravel()])
    second = np.concatenate([number[:, 1:].ravel(), number[1:].ravel()])
    colour = image.reshape(-1, 3) / np.float32(255)
    weight = np.exp(-EDGE * ((colour[first] - colour[second]) ** 2).sum(axis=1)) + MIN_SMOOTHNESS
    diagonal = np.bincount(first, weight, number.size) + np.bincount(second, weight, number.size)
    values = np.concatenate([diagonal, -weight, -weight])
    index = np.concatenate([number.ravel(), first, second]), np.concatenate([number.ravel(), second, first])
    return coo_array((values, index), shape=(number.size, number.size))


class DepthCompletion:
    """Enrichment method that intersects rays between two returns with a completed depth image.

    Args:
        complete: Completes a sparse depth image (H, W) float32 [m, 0 = none], given the image (H, W, 3) uint8 RGB.
        spread_share: Sigma as a share of the spread of depth around the pixel.
    """

    def __init__(self, complete: Callable[[Array, Array], Array], spread_share: float) -> None:
        self.complete, self.spread_share = complete, spread_share

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        """Predict ranges in the camera's field of view; none without an image."""
        ranges, sigma = np.zeros(grid.shape, np.float32), np.full(grid.shape, np.inf, np.float32)
        if scan.image is not None and scan.calibration is not None:
            rays = rays_before_camera(grid, between_returns(scan, grid), scan.calibration, scan.image.shape)
            dense = self.complete(project_scan(scan).image, scan.image)
            met = rays.intersect(dense)
            known = np.isfinite(met)
            ray = rays.row[known], rays.column[known]
            u, v = nearest_pixel(rays.pixels(met)[known])
            ranges[ray] = self.corrected(met, rays, dense, scan, grid)[known]
            sigma[ray] = MIN_SIGMA + self.spread_share * _spread(dense)[v, u]
        return Prediction(ranges, sigma, trusted=is_trusted(ranges, sigma))

    def corrected(self, met: Array, rays: ImageRays, dense: Array, scan: SparseScan, grid: RayGrid) -> Array:
        """Correct the ranges (M,) [m] of the intersections; here they are unchanged."""
        return met


def is_trusted(ranges: Array, sigma: Array) -> Array:
    """Check which ranges are accurate enough for registration: sigma <= TRUSTED_SIGMA or TRUSTED_SHARE of the range."""
    return sigma <= np.maximum(TRUSTED_SIGMA, TRUSTED_SHARE * ranges)


def _spread(dense: Array) -> Array:
    """Difference of the maximum and the minimum depth around each pixel, (H, W) float32 [m]."""
    window = np.ones(WINDOW, np.uint8)
    least = cv2.erode(np.where(dense > 0, dense, np.float32(np.inf)), window)
    return np.asarray(cv2.dilate(dense, window) - np.minimum(least, dense))


nearest_method = partial(DepthCompletion, nearest_sample, NEAREST_SPREAD)
ip_basic_method = partial(DepthCompletion, ip_basic, IP_BASIC_SPREAD)
delaunay_method = partial(DepthCompletion, delaunay, DELAUNAY_SPREAD)
markov_random_field_method = partial(DepthCompletion, markov_random_field, MRF_SPREAD)
