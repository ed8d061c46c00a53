"""Pooling of the depths of points into cells, which are at least as large as pixels."""

from __future__ import annotations

import cv2
import numpy as np

from slam.data.cloud import Array

#: Maximum ratio and difference [m] of depths on the same surface.
SAME, APART = np.float32(1.1), np.float32(1.0)
NOWHERE = 1e6  # m


def cells_of(pixels: Array, scale: float) -> Array:
    """Return the cells (N, 2) int64, column and row, of pixels (N, 2); pixel centres are at integers."""
    return np.floor((np.floor(np.asarray(pixels) + 0.5) + 0.5) * scale).astype(np.int64)


def nearest_depth(cells: Array, depth: Array, shape: tuple[int, int]) -> Array:
    """Compute the minimum depth (N,) in each cell, that of the occluding return, (H, W) float32 [m], 0 = none."""
    index, inside = _index(cells, shape)
    image = np.full(shape[0] * shape[1], np.inf, np.float32)
    np.minimum.at(image, index, depth[inside].astype(np.float32))
    return np.where(np.isinf(image), np.float32(0), image).reshape(shape)


def pooled(cells: Array, depth: Array, shape: tuple[int, int]) -> Array:
    """Pool depths per cell, (H, W) float32 [m], 0 = none.

    The result is the mean in inverse depth, which is exact on planes, or the minimum if the points of a cell are on
    surfaces at different distances.
    """
    index, inside = _index(cells, shape)
    inverse = 1 / depth[inside]
    size = shape[0] * shape[1]
    count, total = np.bincount(index, minlength=size), np.bincount(index, inverse, size)
    mean = np.divide(count, total, out=np.zeros(size), where=count > 0).astype(np.float32).reshape(shape)
    least = nearest_depth(cells, depth, shape)
    return np.where(mean <= SAME * least, mean, least)


def in_front(cells: Array, depth: Array, shape: tuple[int, int]) -> Array:
    """Select the points (N,) bool in the image that are on the nearest surface of their and the 8 adjacent cells."""
    least = nearest_depth(cells, depth, shape)
    around = cv2.erode(np.where(least > 0, least, NOWHERE), np.ones((3, 3), np.uint8), borderValue=NOWHERE).ravel()
    index, result = _index(cells, shape)
    result[result] = depth[result] <= np.maximum(SAME * around, around + APART)[index]
    return result


def _index(cells: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Flat indices (M,) of the cells (N, 2) inside the image, and which cells these are, (N,) bool."""
    inside = np.asarray(((cells >= 0) & (cells < shape[::-1])).all(axis=1))
    column, row = cells[inside].T
    return row * shape[1] + column, inside
