"""Interpolation without training: a ray meets the straight line between the returns above and below it.

Exact where the surface is a plane. The calibrated line of the ray is used, in the vertical plane of its column.
"""

from __future__ import annotations

import numpy as np

from enrichment.geometry import kernels
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.cloud import Array

LEAST_SIGMA = 0.02  # m, on top of what grows with the segment
#: Sigma as a share of the segment's length. Collinear neighbours foretell a plane: measured on KITTI, the median error
#: is .03 of the length where the next segment goes on within 5 deg, and .2 to .35 where it turns by more than 20 deg.
STRAIGHT, BENT, TURN = np.float32(0.04), np.float32(0.29), np.float32(np.deg2rad(20))
STEEP, STEEP_SHARE = np.deg2rad(60), np.float32(0.15)
LONG, LONG_FACTOR = 8.0, np.float32(2.5)  # m: from there on segments join an object's edge to what is behind
#: Hedges, fences and branches: where returns beside stick out of a segment's reach, rays pass through it or are
#: stopped before it. Window in columns, slack in metres and as a share, most that one return counts [m], its weight.
WINDOW, SLACK, SLACK_SHARE, LIMIT, THROUGH = 8, 1.0, 0.05, 40.0, np.float32(0.3)
#: The slope gate: short segments, and longer ones on ground and walls. Between, they are false sheets.
SHORT, LONGEST, FLAT = 1.0, 10.0, np.deg2rad(10)  # m, m, rad


class RaySegment:
    """A range wherever both returns are there; trusted are those that pass the slope gate."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        rho, z, length, slope, turn = kernels.segments(scan.cloud.xyz, scan.points)
        sensor, upper = grid.sensor, scan.rows_above(grid.sensor)
        met = kernels.intersect_segments(rho, z, length, upper, np.tan(sensor.elevation), sensor.offset)
        beside = kernels.neighbour_outlier_distance(rho, length, WINDOW, SLACK, SLACK_SHARE, LIMIT)
        short_or_plane = (length < SHORT) | ((length < LONGEST) & ((slope < FLAT) | (slope > STEEP)))
        stretch = (1 / np.cos(sensor.elevation)).astype(np.float32)[:, None]
        return Prediction(
            ranges=met * stretch,
            sigma=np.where(met > 0, sigma_of(length, slope, turn, beside)[upper] * stretch, np.float32(np.inf)),
            trusted=(met > 0) & short_or_plane[upper],
        )


def sigma_of(length: Array, slope: Array, turn: Array, beside: Array) -> Array:
    """(K - 1, W) float32, metres, along rho."""
    share = STRAIGHT + BENT * np.minimum(turn / TURN, 1)
    share = np.where(slope > STEEP, np.maximum(share, STEEP_SHARE), share)
    share = np.where(length > LONG, share * LONG_FACTOR, share)
    return np.asarray(LEAST_SIGMA + length * share + THROUGH * beside, np.float32)
