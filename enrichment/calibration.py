"""Online calibration of sigma on held-out rings of the scan itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from slam.data.cloud import Array

VALIDATE_EVERY = 5  # scans between validations
HELD_OUT = 2  # rings per validation, not adjacent
MEMORY = 10  # validations that the factor averages over
QUANTILE = 0.68  # share of the errors that sigma must bound
MIN_RETURNS = 100  # a validation with fewer is ignored
BOUNDS = (0.5, 2.0)  # limits of the factor of one validation
#: The gap around a held-out ring is twice as wide as where predictions are used. Segments are longer too, and sigma,
#: which grows with them, is exceeded less often: by a factor of 1.05 to 1.35 on five sequences.
SINGLE_GAP = 1.2


class Calibrated:
    """A method whose sigma is scaled so that it bounds 68 % of the errors on the current scene.

    In every fifth scan two rings, other ones each time, are held out and predicted from the rest. Sigma is multiplied
    by the factor that their errors require, as a geometric mean over the last validations.

    Args:
        method: The method to calibrate.
    """

    def __init__(self, method: Method) -> None:
        self.method = method
        self._scans = self._validations = 0
        self._log_factor = 0.0

    @property
    def factor(self) -> float:
        """Factor on the method's own sigma."""
        return SINGLE_GAP * float(np.exp(self._log_factor)) if self._validations else 1.0

    def state(self) -> list[float]:
        """Return the numbers of scans and validations, and the logarithm of the factor."""
        return [self._scans, self._validations, float(self._log_factor)]

    def restore(self, state: list[float]) -> None:
        """Continue from the state of another one."""
        scans, validations, self._log_factor = state
        self._scans, self._validations = int(scans), int(validations)

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        """Predict ranges with calibrated sigma."""
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
        if len(ratio) < MIN_RETURNS:
            return
        self._validations += 1
        found = np.log(np.clip(np.quantile(ratio, QUANTILE), *BOUNDS))
        self._log_factor += (found - self._log_factor) / min(self._validations, MEMORY)


def relative_errors(method: Method, scan: SparseScan, held: Array) -> Array:
    """Compute |error| / sigma (M,) of the trusted predictions at the returns of the held-out rings `held`."""
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
