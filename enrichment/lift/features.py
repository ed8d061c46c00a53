"""Features of Lift: the measured rings, and candidate ranges for each ray between two rings."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
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
from enrichment.lift.channels import RAYS, RINGS, Candidate, Ray, Ring
from enrichment.lift.kernels import COLUMNS_NEAR
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
    beams = _Beams(upper, tangent, offset)
    candidates = lift_kernels.between_rings(rho, z, length, *beams)
    rays = np.zeros((RAYS, *candidates.shape[1:]), np.float32)
    _add_ratios(rho, upper, rays, candidates)
    known = rays[Ray.KNOWN]
    rays[Ray.SHARE], rays[Ray.GAP] = (own[upper] - lines)[:, None] / gap[upper, None] * known, gap[upper, None] * known
    of_segment = np.log1p(length), slope, np.minimum(turn, 1), np.log1p(outlier_distance), np.log1p(sigma)
    for channel, values in zip(range(Ray.LENGTH, Ray.GAP), of_segment, strict=True):
        rays[channel] = (values * (length > 0))[upper]
    rings = np.zeros((RINGS, *rho.shape), np.float32)
    rings[Ring.KNOWN] = scan.points >= 0
    rings[Ring.RANGE] = np.log(np.maximum(rho, 0.1) / 10) * rings[Ring.KNOWN]
    rings[Ring.HEIGHT] = z / 3 * rings[Ring.KNOWN]
    rings[Ring.GAP_ABOVE, 1:], rings[Ring.GAP_BELOW, :-1] = gap[:, None], gap[:, None]
    with ThreadPoolExecutor(1) as other_core:  # history and image have channels of their own
        history = other_core.submit(_add_history, scan, beams, rho, z, length, gap, rays, candidates)
        if scan.image is not None and scan.calibration is not None:
            _add_image(scan, grid, beams, rho, rings, rays, candidates)
        history.result()
    return LiftInput(rings, upper, rays, candidates, rows)


def _add_ratios(rho: Array, upper: Array, rays: Array, candidates: Array) -> None:
    """Add which rays have returns above and below, and the logarithms of the ranges in relation to the segment's."""
    segment = candidates[Candidate.SEGMENT]
    rays[Ray.KNOWN] = segment > 0
    met = np.log(np.where(segment > 0, segment, np.float32(1)))
    rays[Ray.RANGE] = (met - np.float32(np.log(10))) * rays[Ray.KNOWN]
    measured = np.log(np.where(rho > 0, rho, np.float32(1)))
    rays[Ray.ABOVE] = (measured[upper] - met) * rays[Ray.KNOWN]
    rays[Ray.BELOW] = (measured[upper + 1] - met) * rays[Ray.KNOWN]
    for ray, candidate in ((Ray.FROM_ABOVE, Candidate.FROM_ABOVE), (Ray.FROM_BELOW, Candidate.FROM_BELOW)):
        found = candidates[candidate]
        rays[ray] = np.where(found > 0, np.log(np.where(found > 0, found, np.float32(1))) - met, np.float32(0))


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
    seen = _seen(rings, pixels, rho)
    lift_kernels.guess(rays, candidates, seen, *rest, scaled_ip_basic(sparse, DENSE), DENSE)


def _seen(rings: Array, pixels: Array, rho: Array) -> Array:
    """What the kernel `guess` needs of the returns: pixel, colour (0..255) and rho, 0 outside the image."""
    shown = rings[Ring.SEEN]
    colours = (rings[Ring.RED :] + 1) * np.float32(128) * shown
    channels = np.stack([*np.moveaxis(np.nan_to_num(pixels), -1, 0), *colours, rho * shown], axis=1)
    return np.pad(channels, ((0, 0), (0, 0), (COLUMNS_NEAR, COLUMNS_NEAR)), mode="wrap")


def _add_history(
    scan: SparseScan, beams: _Beams, rho: Array, z: Array, length: Array, gap: Array, rays: Array, candidates: Array
) -> None:
    """Add the features of earlier scans to rays and candidates."""
    if len(scan.past) == 0:
        return
    past = np.zeros((*rays.shape[1:], 6), np.float32)
    past[..., 0], past[..., 3], past[..., 4] = np.inf, np.inf, -np.inf
    table = lift_kernels.rows_by_slope(beams.tangent, beams.tangent[-1], beams.tangent[0])
    for age, (then, T_now_then) in enumerate(reversed(scan.past), start=1):
        pose = np.ascontiguousarray(T_now_then, np.float64)
        now = rho, z, length, candidates[Candidate.SEGMENT]
        lift_kernels.accumulate_history(past, then.xyz, pose, age, table, *now, *beams, gap)
    lift_kernels.add_history(past, rays, candidates)


def _pinhole(image: Array, calibration: Calibration) -> Array:
    """The image without lens distortion."""
    if not any(calibration.distortion):
        return image
    return np.asarray(cv2.undistort(image, calibration.K, np.array(calibration.distortion)))
