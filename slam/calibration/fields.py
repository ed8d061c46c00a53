"""Edge fields of images: the strength of edges at and near each pixel."""

from __future__ import annotations

import cv2
import numpy as np

from slam.data.camera import project
from slam.data.cloud import Array, Calibration

PRE_BLUR = 1.0  # pixels, against noise
CAP = 98.0  # percentile of the derivatives, so that a few strong edges do not decide
PLAIN = 0.3  # of the image's mean, is added to the mean around: noise on plain surfaces is no edge


def pinhole_grey(image: Array, calibration: Calibration) -> Array:
    """Return an image (H, W, 3) uint8 as a pinhole camera of the same matrix sees it, in grey: (H, W) uint8."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    if not calibration.fisheye and not any(calibration.distortion):
        return np.asarray(grey)
    height, width = grey.shape
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    rays = np.linalg.solve(calibration.K, np.stack([column.ravel(), row.ravel(), np.ones(column.size)]))
    lens = Calibration(calibration.K, np.eye(4), calibration.distortion, fisheye=calibration.fisheye)
    pixels = project(rays.T, lens)[0].astype(np.float32)
    x, y = (np.nan_to_num(pixels[:, axis], nan=-1e4).reshape(height, width) for axis in (0, 1))
    return np.asarray(cv2.remap(grey, x, y, cv2.INTER_LINEAR))


def edge_fields(grey: Array, sigma: float, around: float) -> Array:
    """Return the edge fields (2, H, W) float32 of an image (H, W) uint8.

    The absolute derivatives along x and along y, capped and blurred, relative to their surroundings: 0 means as many
    edges as around, 1 twice as many. Without the surroundings, edges of the LiDAR would be drawn to foliage.

    Args:
        grey: The image.
        sigma: Blur [pixels].
        around: Half the width of the surroundings [pixels].
    """
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), PRE_BLUR)
    fields = []
    size = (2 * round(around) + 1,) * 2
    for x, y in ((1, 0), (0, 1)):
        derivative = np.abs(cv2.Sobel(smooth, cv2.CV_32F, x, y))
        capped = np.minimum(derivative, np.percentile(derivative, CAP))
        mean = cv2.blur(capped, size)
        fields.append(
            (cv2.GaussianBlur(capped, (0, 0), sigma) - mean) / (mean + PLAIN * max(float(capped.mean()), 1.0))
        )
    return np.array(fields, np.float32)
