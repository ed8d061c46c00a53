"""Online calibration of sigma, on rings of the scan itself that are held out while driving."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from slam.data.cloud import Array

VALIDATE_EVERY = 5  # scans from one validation to the next
HELD_OUT = 2  # rings a validation, none of them neighbours
MEMORY = 10  # validations that the factor remembers
WITHIN = 0.68  # share of the errors that sigma has to bound
LEAST_RETURNS = 100  # a validation with fewer says nothing
BOUNDS = (0.5, 2.0)  # of a validation's factor: a scene may be easier or harder, but not without limit
#: Around a ring that is held out the gap is twice as wide as where predictions are used, and so are segments: sigma,
#: which grows with them, is then less exceeded. Measured on five drives: by a factor of 1.05 to 1.35.
SINGLE_GAP = 1.2


class Calibrated:
    """A method whose sigma bounds 68 % of its errors on the present scene.

    Every fifth scan two of its own rings are held out and predicted from the others, in turn; sigma is multiplied by
    what their errors ask for, in the geometric mean of the last validations.
    """

    def __init__(self, method: Method) -> None:
        self.method = method
        self._scans = self._validations = 0
        self._log_factor = 0.0

    @property
    def factor(self) -> float:
        """What the method's own sigma is multiplied by."""
        return SINGLE_GAP * float(np.exp(self._log_factor)) if self._validations else 1.0

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        if self._scans % VALIDATE_EVERY == 0:
            self._validate(scan)
        self._scans += 1
        prediction = self.method(scan, grid)
        return replace(prediction, sigma=prediction.sigma * np.float32(self.factor))

    def _validate(self, scan: SparseScan) -> None:
        inner = scan.rings[1:-1]
        if len(inner) < 2 * HELD_OUT:
            return
        turn = self._scans // VALIDATE_EVERY
        held = inner[(turn + np.arange(HELD_OUT) * (len(inner) // HELD_OUT)) % len(inner)]
        ratio = relative_errors(self.method, scan, held)
        if len(ratio) < LEAST_RETURNS:
            return
        self._validations += 1
        found = np.log(np.clip(np.quantile(ratio, WITHIN), *BOUNDS))
        self._log_factor += (found - self._log_factor) / min(self._validations, MEMORY)


def relative_errors(method: Method, scan: SparseScan, held: Array) -> Array:
    """(M,) |error| / sigma of the trusted predictions at the returns of the rings `held`, made without them."""
    cloud = scan.cloud
    assert cloud.ring is not None
    rows = np.full(scan.lines.ring_count, -1)
    rows[held] = np.arange(len(held))
    lines = scan.lines.only(held)
    grid = RayGrid(lines, scan.columns)
    prediction = method(scan.without(held), grid)
    truth = cloud.select(np.isin(cloud.ring, held))
    row, column = rows[truth.ring], grid.column_of(truth.xyz)
    error = np.abs(prediction.ranges[row, column] - grid.range_of(truth.xyz, row))
    trusted = prediction.trusted[row, column]
    return np.asarray(error[trusted] / prediction.sigma[row, column][trusted])
