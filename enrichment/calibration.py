"""Is sigma true? Asked of the scan itself while driving, by rings that are held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enrichment.rays import Prediction, RayGrid
from enrichment.sparse_scan import Method, SparseScan
from slam.data.cloud import Array

EVERY = 5  # frames between two looks
HELD_OUT = 2  # rings a look, none of them neighbours
MEMORY = 10  # looks that the factor remembers
WITHIN = 0.68  # share of the errors that sigma has to bound
LEAST_RETURNS = 100  # a look with fewer says nothing
BOUNDS = (0.5, 2.0)  # of the factor: a scene may be easier or harder, but not without limit


class SigmaCalibration:
    """The factor that makes a method's sigma bound 68 % of its errors on the present scene.

    Every fifth frame two of the scan's own rings are held out and predicted from the others, in turn over the frames.
    Gaps between rings are twice as wide there as where predictions are used, and so are segments: what is calibrated is
    sigma in terms of them.
    """

    def __init__(self, method: Method) -> None:
        self.method = method
        self._log_factor, self._looks = 0.0, 0

    def update(self, scan: SparseScan, frame: int) -> float:
        """Look at the scan of this frame number, if it is its turn; returns the factor."""
        if frame % EVERY == 0 or self._looks == 0:
            ratio = self._look(scan, frame // EVERY)
            if len(ratio) >= LEAST_RETURNS:
                self._looks += 1
                found = np.log(np.clip(np.quantile(ratio, WITHIN), *BOUNDS))
                self._log_factor += (found - self._log_factor) / min(self._looks, MEMORY)
        return float(np.exp(self._log_factor))

    def _look(self, scan: SparseScan, turn: int) -> Array:
        """(M,) |error| / sigma of the trusted predictions at the returns of the held-out rings."""
        inner = scan.rings[1:-1]
        if len(inner) < 2 * HELD_OUT:
            return np.zeros(0)
        held = inner[(turn + np.arange(HELD_OUT) * (len(inner) // HELD_OUT)) % len(inner)]
        return errors(self.method, scan, held)


def errors(method: Method, scan: SparseScan, held: Array) -> Array:
    """(M,) |error| / sigma of the trusted predictions at the returns of the rings `held`, made without them."""
    cloud = scan.cloud
    assert cloud.ring is not None
    rows = np.full(scan.lines.ring_count, -1)
    rows[held] = np.arange(len(held))
    lines = replace(scan.lines, elevation=scan.lines.elevation[held], offset=scan.lines.offset[held])
    grid = RayGrid(lines, scan.columns)
    prediction: Prediction = method(scan.without(held), grid)
    truth = cloud.select(np.isin(cloud.ring, held))
    row, column = rows[truth.ring], grid.column_of(truth.xyz)
    error = np.abs(prediction.ranges[row, column] - grid.range_of(truth.xyz, row))
    trusted = prediction.trusted[row, column]
    return np.asarray(error[trusted] / prediction.sigma[row, column][trusted])
