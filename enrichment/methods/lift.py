"""Lift as a method of enrichment, run by ONNX Runtime."""

from __future__ import annotations

from importlib.resources.abc import Traversable

import numpy as np

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.lift.channels import COLUMN_MULTIPLE, Candidate, Ray
from enrichment.lift.features import LiftInput, lift_input
from enrichment.methods.onnx_network import WEIGHTS, Fallback, metadata_number, session
from slam.data.cloud import Array

NAME = "lift"
#: Where the scale is larger, the network, which has learned from few streets, is surer of its choice than it should be:
#: half way to the guess is nearer the truth. Chosen on KITTI 0005 and 0013 by weights that have not seen them.
UNSURE_SCALE, HALF_WAY = 1.0, np.float32(0.5)  # m
SIGMA = np.float32(1.15)  # half the width of the central 68 % interval of a Laplace distribution, in its scales


class LiftMethod:
    """The method: ranges on all rays between two returns, with the network's own sigma.

    The camera helps where it sees, and past scans where they are known; without, the rings alone decide. Trusted is
    every ray that is likely to have a return, however unsure: hedges and edges, where nobody is sure, hold the odometry
    forward, and it weighs them by sigma. Without weights or ONNX Runtime it is ray-segment, and the log says so once.
    Raises InputError where the weights are damaged. `parameters` is how many were learned, None where the network
    cannot run.
    """

    parameters: int | None = None

    def __init__(self, folder: Traversable = WEIGHTS) -> None:
        self._fallback = Fallback(NAME)
        self._session = None
        try:
            file = folder / f"{NAME}.onnx"
            self._session = session(file)
            self.parameters = int(metadata_number(self._session, file, "parameters"))
        except (ImportError, FileNotFoundError) as error:
            self._fallback.fault = f"cannot run here ({error})"

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        if self._session is None:
            self._fallback.notice()
            return RaySegment()(scan, grid)
        ranges, sigma = np.zeros(grid.shape, np.float32), np.full(grid.shape, np.inf, np.float32)
        trusted = np.zeros(grid.shape, bool)
        if not (scan.rows_above(grid.sensor) >= 0).any():  # no rays between the rings
            return Prediction(ranges, sigma, trusted)
        given = lift_input(scan, grid)
        rho, scale, valid = self._run(given)
        guess = given.candidates[Candidate.GUESS]
        rho = np.where((guess > 0) & (scale > UNSURE_SCALE), rho + HALF_WAY * (guess - rho), rho)
        known = given.rays[Ray.KNOWN] > 0
        stretch = (1 / np.cos(grid.sensor.elevation[given.rows])).astype(np.float32)[:, None]
        ranges[given.rows] = np.where(known, rho * stretch, np.float32(0))
        sigma[given.rows] = np.where(known, SIGMA * scale * stretch, np.float32(np.inf))
        trusted[given.rows] = known & (valid > 0)
        return Prediction(ranges, sigma, trusted)

    def _run(self, given: LiftInput) -> tuple[Array, Array, Array]:
        """rho, scale and validity, (Q, W) each."""
        assert self._session is not None
        columns = given.rays.shape[-1]
        more = -columns % COLUMN_MULTIPLE
        images = {"rings": given.rings, "rays": given.rays, "candidates": given.candidates}
        around = {name: np.concatenate([one, one[..., :more]], axis=-1)[None] for name, one in images.items()}
        answers = self._session.run(None, {"upper": given.upper, **around})
        rho, scale, valid = (np.asarray(answer[0, :, :columns]) for answer in answers)
        return rho, scale, valid
