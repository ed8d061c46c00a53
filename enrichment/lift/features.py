"""Features of Lift: the measured rings, and candidate ranges for each ray between two rings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from enrichment.geometry import kernels
from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan, heights
from enrichment.interpolation.depth_completion import scaled_ip_basic
from enrichment.interpolation.ray_segment import LIMIT, SLACK, SLACK_SHARE, WINDOW, sigma_of
from enrichment.lift import kernels as lift_kernels
from enrichment.lift.channels import RINGS, Ray, Ring
from slam.data.cloud import Array, Calibration

DENSE = 0.5  # cells per pixel of the completed depth image
BLUR = 2.0  # pixels, standard deviation of the blur that suppresses texture


@dataclass(frozen=True, eq=False)
class LiftInput:
    """Input of Lift for K rings, W columns and the Q rows of a grid that are between two rings.

    Attributes:
        rings: (RINGS, K, W) float32, channels of `enrichment.lift.channels.Ring`.
        upper: (Q,) int64, ring above each row; the next ring is below it.
        rays: (RAYS, Q, W) float32, channels of `Ray`; all 0 if a return above or below is missing.
        candidates: (CANDIDATES, Q, W) float32, channels of `Candidate`: metres along rho, 0 for none.
        rows: (Q,) int64, rows of the grid.
    """

    rings: Array
    upper: Array
    rays: Array
    candidates: Array
    rows: Array


def lift_input(scan: SparseScan, grid: RayGrid) -> LiftInput:
    """Compute the input of Lift from the scan's returns, the grid's lines and the image only: no target can leak."""
    sensor = grid.sensor
    upper = scan.rows_above(sensor)
    rows = np.flatnonzero(upper >= 0)
    upper, tangent, offset = upper[rows], np.tan(sensor.elevation[rows]), sensor.offset[rows]
    rho, z, length, slope, turn = kernels.segments(scan.cloud.xyz, scan.points)
    outlier_distance = kernels.neighbour_outlier_distance(rho, length, WINDOW, SLACK, SLACK_SHARE, LIMIT)
    sigma = sigma_of(length, slope, turn, outlier_distance)
    lines, own = heights(sensor)[rows], heights(scan.lines)[scan.rings]
    gap = own[:-1] - own[1:]
    share = (own[upper] - lines) / gap[upper]
    rays, candidates = lift_kernels.between_rings(
        rho, z, length, slope, turn, outlier_distance, sigma, upper, tangent, offset, share, gap
    )
    rings = np.zeros((RINGS, *rho.shape), np.float32)
    rings[Ring.KNOWN] = scan.points >= 0
    rings[Ring.RANGE] = np.log(np.maximum(rho, 0.1) / 10) * rings[Ring.KNOWN]
    rings[Ring.HEIGHT] = z / 3 * rings[Ring.KNOWN]
    rings[Ring.GAP_ABOVE, 1:], rings[Ring.GAP_BELOW, :-1] = gap[:, None], gap[:, None]
    beams = _Beams(upper, tangent, offset)
    if scan.image is not None and scan.calibration is not None:
        _add_image(scan, grid, beams, rho, rings, rays, candidates)
    _add_history(scan, beams, rho, z, gap, rays, candidates)
    return LiftInput(rings, upper, rays, candidates, rows)


class _Beams(NamedTuple):
    """Lines of Q rows, z = tangent * rho + offset, and the ring `upper` above each, (Q,) each."""

    upper: Array
    tangent: Array
    offset: Array


def _add_image(
    scan: SparseScan, grid: RayGrid, beams: _Beams, rho: Array, rings: Array, rays: Array, candidates: Array
) -> None:
    """Add the features of the image to rings, rays and candidates."""
    assert scan.image is not None
    assert scan.calibration is not None
    image = cv2.GaussianBlur(_pinhole(scan.image, scan.calibration), (0, 0), BLUR)
    camera = scan.calibration.K @ scan.calibration.T_camera_lidar[:3]
    pixels = lift_kernels.colours_of_rings(scan.cloud.xyz, scan.points, camera, image, rings[Ring.SEEN :])
    rest = *beams, np.cos(grid.azimuth), np.sin(grid.azimuth), camera, image
    lift_kernels.along_image(rays, candidates, pixels, *rest)
    sparse = np.zeros([round(DENSE * size) for size in image.shape[:2]], np.float32)
    lift_kernels.depths_seen(scan.cloud.xyz, scan.points, pixels, camera, DENSE, sparse)
    lift_kernels.guess(rays, candidates, pixels, *rest, rho, scaled_ip_basic(sparse, DENSE), DENSE)


def _add_history(
    scan: SparseScan, beams: _Beams, rho: Array, z: Array, gap: Array, rays: Array, candidates: Array
) -> None:
    """Add the features of earlier scans to rays and candidates."""
    best = np.full(rays.shape[1:], np.inf, np.float32)
    for age, (then, T_now_then) in enumerate(reversed(scan.past), start=1):
        pose = np.ascontiguousarray(T_now_then, np.float64)
        lift_kernels.accumulate_history(rays, candidates, best, then.xyz, pose, age, rho, z, *beams, gap)
    np.log1p(rays[Ray.PAST_RETURNS], out=rays[Ray.PAST_RETURNS])


def _pinhole(image: Array, calibration: Calibration) -> Array:
    """The image without lens distortion."""
    if not any(calibration.distortion):
        return image
    return np.asarray(cv2.undistort(image, calibration.K, np.array(calibration.distortion)))
