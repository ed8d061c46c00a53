"""Sparse depth images made dense without training, and methods of enrichment made of that."""

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

from enrichment.geometry.image_rays import ImageRays, between_returns, rays_before_camera, see
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.camera import nearest_pixel
from slam.data.cloud import Array

#: IP-Basic: pixels, the first (H, W). Sixteen rings are some 20 rows apart, so it is tall; for 64 rings it is 5.
TALL, CLOSE, FILL, LARGE_FILL, BLUR = (21, 5), 9, 9, 31, 5
ROOM = 20.0  # m, that inverted depths are larger than 0

#: Markov random field: pixels a side that share one depth; how fast smoothness falls with the squared difference of
#: neighbouring colours (0..1 each), and to what; weight of a return against a neighbour of the same colour.
CELL, EDGE, LEAST_SMOOTH, DATA = 2, 30.0, 0.01, 10.0
TOLERANCE, ITERATIONS = 1e-4, 500  # relative residual at which conjugate gradients stop; a bound

#: Sigma: a share of the spread of depth around the pixel, in a window (H, W) that reaches beyond the rings next to it.
#: Measured on KITTI, 16 of 64 rings; what interpolates planes has less.
WINDOW, LEAST_SIGMA = (41, 13), 0.05
NEAREST_SPREAD, IP_BASIC_SPREAD, DELAUNAY_SPREAD, MRF_SPREAD = 0.19, 0.19, 0.035, 0.1
AT_COVERAGE, SURE_SHARE = 0.1, 0.02  # m; of the range


def nearest_sample(sparse: Array, _image: Array) -> Array:
    """Each pixel takes the depth of the nearest pixel that has one."""
    if not sparse.any():
        return sparse
    index = distance_transform_edt(sparse == 0, return_distances=False, return_indices=True)
    return np.asarray(sparse[tuple(index)])


def ip_basic(sparse: Array, _image: Array) -> Array:
    """Morphology on inverted depth, so that nearer surfaces win (Ku, Harakeh, Waslander, "In Defense of Classical Image
    Processing", CRV 2018), with a tall first kernel. The image's top is not filled with the highest depths: it is sky.
    """
    return morphed(sparse, 1.0)


def morphed(sparse: Array, scale: float) -> Array:
    """The same on depth images of `scale` cells a pixel."""
    if not sparse.any():
        return sparse
    tall, aside, close, fill, large, blur = (
        max(2 * round((size * scale - 1) / 2) + 1, 3) for size in (*TALL, CLOSE, FILL, LARGE_FILL, BLUR)
    )
    far = np.float32(sparse.max() + ROOM)
    inverted = np.where(sparse > 0, far - sparse, np.float32(0))
    inverted = cv2.dilate(inverted, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (aside, tall)))
    inverted = cv2.morphologyEx(inverted, cv2.MORPH_CLOSE, np.ones((close, close), np.uint8))
    for size in (fill, large):
        inverted = np.where(inverted > 0, inverted, cv2.dilate(inverted, np.ones((size, size), np.uint8)))
    inverted = cv2.medianBlur(inverted, blur)
    known = inverted > 0
    share = cv2.GaussianBlur(known.astype(np.float32), (blur, blur), 0)  # of a blurred depth that is known
    return np.where(known, far - cv2.GaussianBlur(inverted, (blur, blur), 0) / np.maximum(share, 1e-6), np.float32(0))


def delaunay(sparse: Array, _image: Array) -> Array:
    """Linear in inverse depth on the triangles between the samples: exact on planes. Nothing outside their hull."""
    v, u = np.nonzero(sparse)
    try:
        triangles = Delaunay(np.column_stack([u, v]))
    except (QhullError, ValueError):  # fewer than three, or all in a line
        return np.zeros_like(sparse)
    inverse = LinearNDInterpolator(triangles, 1 / sparse[v, u].astype(float), fill_value=np.inf)
    rows, columns = np.indices(sparse.shape)
    return np.asarray(1 / inverse(columns, rows), np.float32)


def markov_random_field(sparse: Array, image: Array) -> Array:
    """The inverse depth that minimises sum DATA (x - sample)^2 + sum w_ij (x_i - x_j)^2 over neighbours, with
    w = exp(-EDGE |colour_i - colour_j|^2) (Diebel & Thrun, NIPS 2005; theirs is in depth), by conjugate gradients.

    On cells of CELL x CELL pixels: at half the image's resolution.
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
    """The graph Laplacian (H W, H W) of an image's (H, W, 3) neighbouring pixels, by their weights."""
    number = np.arange(image[..., 0].size).reshape(image.shape[:2])
    first = np.concatenate([number[:, :-1].ravel(), number[:-1].ravel()])
    second = np.concatenate([number[:, 1:].ravel(), number[1:].ravel()])
    colour = image.reshape(-1, 3) / np.float32(255)
    weight = np.exp(-EDGE * ((colour[first] - colour[second]) ** 2).sum(axis=1)) + LEAST_SMOOTH
    diagonal = np.bincount(first, weight, number.size) + np.bincount(second, weight, number.size)
    values = np.concatenate([diagonal, -weight, -weight])
    index = np.concatenate([number.ravel(), first, second]), np.concatenate([number.ravel(), second, first])
    return coo_array((values, index), shape=(number.size, number.size))


class DepthCompletion:
    """The method: rays before the camera, between two returns, end at the completed depth image.

    Args:
        complete: Makes a dense depth image (H, W) float32 of a sparse one, [m, 0 = none], and of the image (H, W, 3)
            uint8 RGB.
        spread_share: Sigma as a share of the spread of depth around the pixel.
    """

    def __init__(self, complete: Callable[[Array, Array], Array], spread_share: float) -> None:
        self.complete, self.spread_share = complete, spread_share

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        ranges, sigma = np.zeros(grid.shape, np.float32), np.full(grid.shape, np.inf, np.float32)
        if scan.image is not None and scan.calibration is not None:
            rays = rays_before_camera(grid, between_returns(scan, grid), scan.calibration, scan.image.shape)
            dense = self.complete(see(scan).image, scan.image)
            met = rays.intersect(dense)
            known = np.isfinite(met)
            ray = rays.row[known], rays.column[known]
            u, v = nearest_pixel(rays.pixels(met)[known])
            ranges[ray] = self.corrected(met, rays, dense, scan, grid)[known]
            sigma[ray] = LEAST_SIGMA + self.spread_share * _spread(dense)[v, u]
        return Prediction(ranges, sigma, trusted=sure(ranges, sigma))

    def corrected(self, met: Array, rays: ImageRays, dense: Array, scan: SparseScan, grid: RayGrid) -> Array:
        """(M,) metres, of ranges (M,) at which rays met the depth image: here, the same."""
        return met


def sure(ranges: Array, sigma: Array) -> Array:
    """Which ranges are to be trusted, bool: those with a sigma of at most AT_COVERAGE, or SURE_SHARE of the range."""
    return sigma <= np.maximum(AT_COVERAGE, SURE_SHARE * ranges)


def _spread(dense: Array) -> Array:
    """(H, W) float32, metres: the difference of the largest and the least depth around each pixel."""
    window = np.ones(WINDOW, np.uint8)
    least = cv2.erode(np.where(dense > 0, dense, np.float32(np.inf)), window)
    return np.asarray(cv2.dilate(dense, window) - np.minimum(least, dense))


nearest_method = partial(DepthCompletion, nearest_sample, NEAREST_SPREAD)
ip_basic_method = partial(DepthCompletion, ip_basic, IP_BASIC_SPREAD)
delaunay_method = partial(DepthCompletion, delaunay, DELAUNAY_SPREAD)
markov_random_field_method = partial(DepthCompletion, markov_random_field, MRF_SPREAD)
