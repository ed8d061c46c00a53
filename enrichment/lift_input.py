"""What Lift is given: the measured rings, and for each ray between two of them the ranges that it may have."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from enrichment import kernels, lift_kernels
from enrichment.ray_segment import LIMIT, SLACK, SLACK_SHARE, WINDOW, sigma_of
from enrichment.rays import RayGrid
from enrichment.sparse_scan import SparseScan, heights
from slam.data.cloud import Array, Calibration

RING_CHANNELS = ("known", "range", "height", "gap above", "gap below", "seen", "red", "green", "blue")
#: Ranges that a ray may have; the last one needs the image. All lie on the ray.
CANDIDATES = ("segment", "above", "below", "from above", "from below", "edge")
RAY_CHANNELS = (
    "known", "share", "range", *CANDIDATES[1:], "length", "slope", "turn", "beside", "sigma", "gap",
    "seen", "change above", "change below", "colour above", "colour below",
)  # fmt: skip
BLUR = 2.0  # pixels, standard deviation: texture is no edge


@dataclass(frozen=True, eq=False)
class LiftInput:
    """Of K rings, W columns and the Q rows of a grid that lie between two rings.

    rings       (RING_CHANNELS, K, W) float32
    upper       (Q,) int64: the ring above each row; the next one is below it
    rays        (RAY_CHANNELS, Q, W) float32; all 0 where a return above or below is missing
    candidates  (CANDIDATES, Q, W) float32, metres along the ray's rho; 0 where there is none
    rows        (Q,) int64: which rows of the grid these are
    """

    rings: Array
    upper: Array
    rays: Array
    candidates: Array
    rows: Array


def lift_input(scan: SparseScan, grid: RayGrid) -> LiftInput:
    """Nothing but the scan's own returns, the lines of the grid and the image enter: no answer can leak."""
    sensor = grid.sensor
    upper = scan.rows_above(sensor)
    rows = np.flatnonzero(upper >= 0)
    upper, tangent, offset = upper[rows], np.tan(sensor.elevation[rows]), sensor.offset[rows]
    rho, z, length, slope, turn = kernels.segments(scan.cloud.xyz, scan.points)
    beside = kernels.sticking_out(rho, length, WINDOW, SLACK, SLACK_SHARE, LIMIT)
    sigma = sigma_of(length, slope, turn, beside)
    lines, own = heights(sensor)[rows], heights(scan.lines)[scan.rings]
    gap = own[:-1] - own[1:]
    share = (own[upper] - lines) / gap[upper]
    rays, candidates = lift_kernels.between_rings(
        rho, z, length, slope, turn, beside, sigma, upper, tangent, offset, share, gap, len(RAY_CHANNELS)
    )
    rings = np.zeros((len(RING_CHANNELS), *rho.shape), np.float32)
    rings[0] = scan.points >= 0
    rings[1] = np.log(np.maximum(rho, 0.1) / 10) * rings[0]
    rings[2] = z / 3 * rings[0]
    rings[3, 1:], rings[4, :-1] = gap[:, None], gap[:, None]
    if scan.image is not None and scan.calibration is not None:
        image = cv2.GaussianBlur(_pinhole(scan.image, scan.calibration), (0, 0), BLUR)
        projection = scan.calibration.K @ scan.calibration.T_camera_lidar[:3]
        pixels = lift_kernels.colours_of_rings(scan.cloud.xyz, scan.points, projection, image, rings[5:])
        directions = np.cos(grid.azimuth), np.sin(grid.azimuth)
        lift_kernels.along_image(rays, candidates, pixels, upper, tangent, offset, *directions, projection, image)
    return LiftInput(rings, upper, rays, candidates, rows)


def _pinhole(image: Array, calibration: Calibration) -> Array:
    """The image without its lens's distortion."""
    if not any(calibration.distortion):
        return image
    return np.asarray(cv2.undistort(image, calibration.K, np.array(calibration.distortion)))
