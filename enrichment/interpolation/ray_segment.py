"""Interpolation without training: each ray is intersected with the segment between the returns above and below it.

The result is exact on planes. The calibrated line of the ray is used, in the vertical plane of its column.
"""

from __future__ import annotations

import numpy as np

from enrichment.geometry import kernels
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.cloud import Array

MIN_SIGMA = 0.02  # m, in addition to the part that grows with the segment
#: Sigma as a share of the segment's length. Collinear neighbours indicate a plane: on KITTI the median error is .03 of
#: the length if the next segment continues within 5 deg, and .2 to .35 if it turns by more than 20 deg.
STRAIGHT, BENT, TURN = np.float32(0.04), np.float32(0.29), np.float32(np.deg2rad(20))
STEEP, STEEP_SHARE = np.deg2rad(60), np.float32(0.15)
LONG, LONG_FACTOR = 8.0, np.float32(2.5)  # m: longer segments mostly join an object's edge with the background
#: Hedges, fences and branches: if neighbouring returns are outside of a segment's range interval, rays pass through the
#: segment or end before it. Window [columns], slack [m] and as a share, maximum per return [m], weight in sigma.
WINDOW, SLACK, SLACK_SHARE, LIMIT, THROUGH = 8, 1.0, 0.05, 40.0, np.float32(0.3)
#: Slope gate: trusted are short segments, and longer ones on ground and walls; others are mostly false surfaces.
SHORT, LONGEST, FLAT = 1.0, 10.0, np.deg2rad(10)  # m, m, rad


class RaySegment:
    """Enrichment method by ray segments: predicts a range between two returns, trusted if it passes the slope gate."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        """Predict ranges between the rings."""
        if len(scan.rings) < 2:
            return Prediction.empty(grid.shape)
        rho, z, length, slope, turn = kernels.segments(scan.cloud.xyz, scan.points)
        sensor, upper = grid.sensor, scan.rows_above(grid.sensor)
        met = kernels.intersect_segments(rho, z, length, upper, np.tan(sensor.elevation), sensor.offset)
        outlier_distance = kernels.neighbour_outlier_distance(rho, length, WINDOW, SLACK, SLACK_SHARE, LIMIT)
        sigma = sigma_of(length, slope, turn, outlier_distance)
        short_or_plane = (length < SHORT) | ((length < LONGEST) & ((slope < FLAT) | (slope > STEEP)))
        stretch = (1 / np.cos(sensor.elevation)).astype(np.float32)[:, None]
        return Prediction(
            ranges=met * stretch,
            sigma=np.where(met > 0, sigma[upper] * stretch, np.float32(np.inf)),
            trusted=(met > 0) & short_or_plane[upper],
        )


def sigma_of(length: Array, slope: Array, turn: Array, outlier_distance: Array) -> Array:
    """Compute sigma along rho, (K - 1, W) float32 [m], from the figures of segments, (K - 1, W) each."""
    share = STRAIGHT + BENT * np.minimum(turn / TURN, 1)
    share = np.where(slope > STEEP, np.maximum(share, STEEP_SHARE), share)
    share = np.where(length > LONG, share * LONG_FACTOR, share)
    return np.asarray(MIN_SIGMA + length * share + THROUGH * outlier_distance, np.float32)
