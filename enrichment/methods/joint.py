"""Ray segments guided by the image: where a segment is uncertain, the image helps to choose between surfaces.

Uncertain are the rays whose ray-segment sigma is large: one ray in eight, with most of the error. Their range is Lift's
candidate GUESS: a weighted median of the ranges of returns nearby in the image, weighted by similarity of colour, and
of two guesses: the depth image completed by IP-Basic, and the position of the colour change between the returns above
and below. A median chooses one surface; a mean would put points between surfaces.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.depth_completion import is_trusted
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.lift.channels import Candidate, Ray
from enrichment.lift.features import lift_input

MIN_SIGMA, SPREAD_SHARE = 0.02, 0.7  # m; share of the guesses' mean distance from their median, measured on KITTI


class Joint:
    """Enrichment method: ray-segment, with the image where the segment is uncertain; without an image, ray-segment."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        """Predict ranges between the rings."""
        plain = RaySegment()(scan, grid)
        if scan.image is None or scan.calibration is None or len(scan.rings) < 2:
            return plain
        given = lift_input(replace(scan, read_past=tuple), grid)
        guess, row, stretch = given.candidates[Candidate.GUESS], given.rows, 1 / np.cos(grid.sensor.elevation)
        known = np.zeros(grid.shape, bool)
        known[row] = guess > 0
        along, spread = np.zeros(grid.shape, np.float32), np.zeros(grid.shape, np.float32)
        along[row] = guess * stretch[row, None]
        spread[row] = np.expm1(given.rays[Ray.GUESS_SPREAD]) * stretch[row, None]
        sigma = MIN_SIGMA + np.float32(SPREAD_SHARE) * spread
        return Prediction(
            ranges=np.where(known, along, plain.ranges),
            sigma=np.where(known, sigma, plain.sigma),
            trusted=plain.trusted | (known & is_trusted(along, sigma)),
        )
