"""What the camera sees of the LiDAR's points: where they fall in the image, which are hidden, what colour they have."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.ndimage import minimum_filter

from slam.data.cloud import Array, Calibration, PointCloud, View

#: A point is hidden behind a return that is nearer by more than the larger of metres and share of its depth, and at
#: most so many rows and columns of pixels away: the LiDAR stands higher and looks over things.
NEARER, NEARER_SHARE = 1.0, 0.05
WINDOW_ROWS, WINDOW_COLUMNS = 4, 3


def project(xyz: Array, calibration: Calibration) -> tuple[Array, Array]:
    """Pixels (N, 2) float64 (u to the right, v down; whole numbers are pixel centres) and depth (N,) float64 [m].

    Points (N, 3) in the LiDAR's frame as recorded, before deskewing. Pixels are NaN behind the camera, for a fisheye
    lens, too, and where the lens's distortion folds back: its model would put points from far outside into the image.
    """
    T, K = calibration.T_camera_lidar, calibration.K
    points = np.einsum("ij,nj->ni", T[:3, :3], xyz) + T[:3, 3]  # `@` waits long for BLAS's threads
    depth = points[:, 2]
    plane = np.full((len(points), 2), np.nan)
    np.divide(points[:, :2], depth[:, None], out=plane, where=depth[:, None] > 0)
    if calibration.fisheye:
        plane = _equidistant(plane, calibration.distortion)
    elif any(calibration.distortion):
        plane = _distorted(plane, calibration.distortion)
    return np.einsum("ij,nj->ni", K[:2, :2], plane) + K[:2, 2], depth


def visible(pixels: Array, depth: Array, shape: tuple[int, ...]) -> Array:
    """(N,) bool: which points, projected by `project`, an image of `shape` (H, W, ...) shows: inside and not hidden."""
    height, width = shape[:2]
    with np.errstate(invalid="ignore"):
        inside: Array = np.all((pixels >= -0.5) & (pixels < (width - 0.5, height - 0.5)), axis=1)
    shown = np.flatnonzero(inside)
    column, row = nearest_pixel(pixels[shown])
    nearest = np.full((height, width), np.inf)
    np.minimum.at(nearest, (row, column), depth[shown])
    around = minimum_filter(nearest, (2 * WINDOW_ROWS + 1, 2 * WINDOW_COLUMNS + 1), mode="nearest")[row, column]
    inside[shown] = depth[shown] - around <= np.maximum(NEARER, NEARER_SHARE * depth[shown])
    return inside


def with_colour(cloud: PointCloud, image: Array, calibration: Calibration) -> PointCloud:
    """The cloud with the colours of an image (H, W, 3) uint8 RGB taken at the same time.

    Black (0, 0, 0) means that the camera did not see the point; what is black itself becomes (1, 1, 1).
    """
    pixels, depth = project(cloud.xyz, calibration)
    seen = visible(pixels, depth, image.shape)
    column, row = nearest_pixel(pixels[seen])
    colour = np.zeros((len(cloud), 3), np.uint8)
    colour[seen] = image[row, column]
    colour[seen & ~colour.any(axis=1)] = 1
    return replace(cloud, colour=colour)


def with_colours(cloud: PointCloud, views: Iterable[View]) -> PointCloud:
    """The same of several cameras: each point has the colour that the first of them saw. As it is without images."""
    for view in views:
        if (image := view.read_image()) is not None:
            before, seen = cloud.colour, with_colour(cloud, image, view.calibration).colour
            if before is not None and seen is not None:
                seen = np.where(before.any(axis=1, keepdims=True), before, seen)
            cloud = replace(cloud, colour=seen)
    return cloud


def nearest_pixel(pixels: Array) -> tuple[Array, Array]:
    """Columns and rows, (...) int64 each, of pixels (..., 2)."""
    column, row = np.moveaxis(np.floor(pixels + 0.5).astype(np.int64), -1, 0)
    return column, row


def _distorted(plane: Array, coefficients: tuple[float, ...]) -> Array:
    """OpenCV's lens model on the plane at depth 1, (N, 2); NaN where it folds back."""
    import cv2  # takes a while to import, and rectified images do not need it

    inside = np.linalg.norm(plane, axis=1) < _fold(coefficients)  # never so for NaN
    points = np.column_stack([plane[inside], np.ones(inside.sum())])
    result = np.full_like(plane, np.nan)
    if len(points):
        at_origin = np.zeros(3)
        result[inside] = cv2.projectPoints(points, at_origin, at_origin, np.eye(3), np.array(coefficients))[0][:, 0]
    return result


def _fold(coefficients: tuple[float, ...]) -> float:
    """Radius on the plane at depth 1 from which on the model (k1 k2 p1 p2 [k3 [k4 k5 k6]]) draws points inwards."""
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, *(0.0,) * 8)[:8]
    radius = np.linspace(0, 10, 5001)  # to 84 degrees off the axis
    s = radius**2
    image = radius * (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    falls = np.flatnonzero(np.diff(image) <= 0)
    return float(radius[falls[0]]) if len(falls) else np.inf


def _equidistant(plane: Array, coefficients: tuple[float, ...]) -> Array:
    """The fisheye model of OpenCV (Kannala and Brandt, PAMI 2006) on the plane at depth 1, (N, 2): a ray at angle t off
    the axis is drawn at t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8). NaN where that folds back."""
    k = np.array([1.0, *coefficients, *(0.0,) * (4 - len(coefficients))])
    radius = np.linalg.norm(plane, axis=1)
    angle = np.arctan(radius)
    growth = np.polynomial.Polynomial(k * (1 + 2 * np.arange(5)))  # of the drawn radius with the angle, in its square
    angles = np.linspace(0, np.pi / 2, 2001)
    falls = np.flatnonzero(growth(angles**2) <= 0)
    drawn = angle * np.polynomial.Polynomial(k)(angle**2)
    drawn[angle >= (angles[falls[0]] if len(falls) else np.inf)] = np.nan
    scale = np.ones(len(plane))
    np.divide(drawn, radius, out=scale, where=radius > 0)
    return plane * scale[:, None]
