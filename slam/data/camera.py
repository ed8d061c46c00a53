"""Projection of the LiDAR's points into images: pixels, visibility, colours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from slam.data import kernels
from slam.data.cloud import Array, Calibration, PointCloud, View

#: A point is hidden if a return within a window of pixels is nearer by more than NEARER [m] and more than NEARER_SHARE
#: of the point's depth: the LiDAR is mounted higher and sees over objects.
NEARER, NEARER_SHARE = 1.0, 0.05
WINDOW_ROWS, WINDOW_COLUMNS = 4, 3


def project(xyz: Array, calibration: Calibration) -> tuple[Array, Array]:
    """Project points into the image.

    Args:
        xyz: (N, 3), in the LiDAR's frame as recorded, before deskewing [m].
        calibration: Calibration of the camera.

    Returns:
        Pixels (N, 2) float64, u to the right and v down, with integers at pixel centres; and depths (N,) float64 [m].
        Pixels are NaN behind the camera, also of a fisheye lens, and where the lens model folds back: there the model
        would project points from far outside into the image.
    """
    T, K = np.ascontiguousarray(calibration.T_camera_lidar, float), np.ascontiguousarray(calibration.K, float)
    xyz = np.ascontiguousarray(xyz)
    if not calibration.fisheye and not any(calibration.distortion):
        return kernels.project(xyz, T, K)
    plane, depth = kernels.project(xyz, T, np.eye(3))
    lens = _equidistant if calibration.fisheye else _distorted
    plane = lens(plane, calibration.distortion)
    return np.einsum("ij,nj->ni", K[:2, :2], plane) + K[:2, 2], depth


def visible(pixels: Array, depth: Array, shape: tuple[int, ...]) -> Array:
    """Return which points the image shows: inside and not hidden by nearer ones, (N,) bool.

    Args:
        pixels: (N, 2), from `project`.
        depth: (N,), from `project` [m].
        shape: Shape (H, W, ...) of the image.
    """
    about = (*shape[:2], WINDOW_ROWS, WINDOW_COLUMNS, NEARER, NEARER_SHARE)
    return np.asarray(kernels.visible(np.asarray(pixels, float), np.asarray(depth, float), *about))


def with_colour(cloud: PointCloud, image: Array, calibration: Calibration) -> PointCloud:
    """Return the cloud with the colours of an image (H, W, 3) uint8 RGB taken at the same time.

    Black (0, 0, 0) means that the camera did not see the point; a black pixel gives (1, 1, 1).
    """
    pixels, depth = project(cloud.xyz, calibration)
    shown = visible(pixels, depth, image.shape)
    return replace(cloud, colour=kernels.pixels_of(image, pixels, shown))


def with_colours(cloud: PointCloud, views: Iterable[View]) -> PointCloud:
    """Return the cloud with the colours of several cameras: each point has the colour of the first that saw it.

    Without images, the cloud is returned unchanged.
    """
    for view in views:
        if (image := view.read_image()) is not None:
            before, seen = cloud.colour, with_colour(cloud, image, view.calibration).colour
            if before is not None and seen is not None:
                seen = np.where(before.any(axis=1, keepdims=True), before, seen)
            cloud = replace(cloud, colour=seen)
    return cloud


def nearest_pixel(pixels: Array) -> tuple[Array, Array]:
    """Return columns and rows, (...) int64 each, of pixels (..., 2)."""
    column, row = np.moveaxis(np.floor(pixels + 0.5).astype(np.int64), -1, 0)
    return column, row


def _distorted(plane: Array, coefficients: tuple[float, ...]) -> Array:
    """OpenCV's lens model on the plane at depth 1, (N, 2); NaN where the model folds back."""
    import cv2  # takes a while to import, and rectified images do not need it

    inside = np.linalg.norm(plane, axis=1) < _fold(coefficients)  # never so for NaN
    points = np.column_stack([plane[inside], np.ones(inside.sum())])
    result = np.full_like(plane, np.nan)
    if len(points):
        at_origin = np.zeros(3)
        result[inside] = cv2.projectPoints(points, at_origin, at_origin, np.eye(3), np.array(coefficients))[0][:, 0]
    return result


def _fold(coefficients: tuple[float, ...]) -> float:
    """Radius on the plane at depth 1 beyond which the model (k1 k2 p1 p2 [k3 [k4 k5 k6]]) moves points inwards."""
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, *(0.0,) * 8)[:8]
    radius = np.linspace(0, 10, 5001)  # to 84 degrees off the axis
    s = radius**2
    image = radius * (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    falls = np.flatnonzero(np.diff(image) <= 0)
    return float(radius[falls[0]]) if len(falls) else np.inf


def _equidistant(plane: Array, coefficients: tuple[float, ...]) -> Array:
    """OpenCV's fisheye model (Kannala and Brandt, PAMI 2006) on the plane at depth 1, (N, 2); NaN where it folds back.

    A ray at angle t from the axis is projected to the radius t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8).
    """
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
