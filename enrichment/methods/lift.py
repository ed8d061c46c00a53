"""Lift as an enrichment method, run by ONNX Runtime."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from importlib.resources.abc import Traversable

import numpy as np

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.lift.channels import COLUMN_MULTIPLE, Candidate, Ray
from enrichment.lift.features import LiftInput, lift_input
from enrichment.methods.onnx_network import WEIGHTS, Fallback, metadata_number, session
from slam.data.cloud import Array
from slam.data.machine import usable_cores
from slam.data.sensor import Sensor

NAME = "lift"
#: At larger scales the network, trained on few streets, is overconfident: the mean of its range and of the candidate
#: GUESS is more accurate. Chosen on KITTI 0005 and 0013, by weights trained without them.
UNCERTAIN_SCALE, GUESS_WEIGHT = 1.0, np.float32(0.5)  # m
#: Widths of gaps between rings in training [rad]: every 2nd, 4th or 8th ring of an HDL-64E, 0.61 to 4.28 deg.
LEARNED_GAPS = np.deg2rad((0.6, 4.3))
ROWS = 5  # of rays at a time: 30 MB less than all at once
SIGMA = np.float32(1.15)  # half the width of the central 68 % interval of a Laplace distribution, in its scales


def learned_gaps(lines: Sensor, rings: Array) -> Array:
    """Check which gaps between successive rings (K,), top first, are as wide as gaps of the training: (K - 1,) bool."""
    gaps = -np.diff(lines.elevation[rings])
    return np.asarray((gaps > LEARNED_GAPS[0]) & (gaps < LEARNED_GAPS[1]))


def gap_note(lines: Sensor, rings: Array) -> str | None:
    """Say between how many of the rings (K,) Lift is replaced by ray-segment; None if everywhere Lift is used."""
    learned = learned_gaps(lines, rings)
    if learned.all():
        return None
    low, high = np.rad2deg(LEARNED_GAPS)
    return (
        f"{NAME}: {np.sum(~learned)} of the {len(learned)} gaps between rings are not between {low:.1f} and {high:.1f} "
        "deg wide, as those it was trained on; ray-segment is used there"
    )


class LiftMethod:
    """Enrichment method Lift: ranges on all rays between two returns, with sigma of the network.

    Between rings that are nearer to each other or farther apart than those of its training, ray-segment is used.

    The image and past scans are used where available; otherwise the rings alone. Every ray that is likely to have a
    return is trusted, even with a large sigma: uncertain returns (vegetation, depth edges) still constrain the forward
    motion, and the odometry down-weights them by sigma. Without weights or ONNX Runtime ray-segment is used, and this
    is logged once.

    Args:
        folder: Folder of the weights.

    Attributes:
        parameters: Number of learned parameters, None if the network cannot run.

    Raises:
        InputError: The weights are damaged.
    """

    parameters: int | None = None

    def __init__(self, folder: Traversable = WEIGHTS) -> None:
        self._fallback = Fallback(NAME)
        try:
            file = folder / f"{NAME}.onnx"
            self._over_rings, self._along_rays = session(file), session(folder / f"{NAME}_rays.onnx", threads=1)
            self.parameters = int(metadata_number(self._over_rings, file, "parameters"))
        except (ImportError, FileNotFoundError) as error:
            self._fallback.fault = f"cannot run here ({error})"

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        """Predict ranges between the rings."""
        if self._fallback.fault:
            self._fallback.notice()
            return RaySegment()(scan, grid)
        upper = scan.rows_above(grid.sensor)
        rows = np.flatnonzero(upper >= 0)
        rows = rows[learned_gaps(scan.lines, scan.rings)[upper[rows]]]
        other = len(rows) < (upper >= 0).sum()
        prediction = RaySegment()(scan, grid) if other else Prediction.empty(grid.shape)
        if len(rows) == 0:
            return prediction
        given = lift_input(scan, RayGrid(grid.sensor.only(rows), grid.columns))
        rho, scale, valid = self._run(given)
        guess = given.candidates[Candidate.GUESS]
        rho = np.where((guess > 0) & (scale > UNCERTAIN_SCALE), rho + GUESS_WEIGHT * (guess - rho), rho)
        known = given.rays[Ray.KNOWN] > 0
        stretch = (1 / np.cos(grid.sensor.elevation[rows])).astype(np.float32)[:, None]
        prediction.ranges[rows] = np.where(known, rho * stretch, np.float32(0))
        prediction.sigma[rows] = np.where(known, SIGMA * scale * stretch, np.float32(np.inf))
        prediction.trusted[rows] = known & (valid > 0)
        return prediction

    def _run(self, given: LiftInput) -> tuple[Array, Array, Array]:
        """Return rho, scale and validity, (Q, W) each."""
        count, columns = given.rays.shape[1:]
        more = -columns % COLUMN_MULTIPLE
        (between,) = self._over_rings.run(None, {"rings": _batch(given.rings, more)})

        def predicted(first: int) -> list[Array]:
            rows = slice(first, first + ROWS)
            rays, candidates = _batch(given.rays[:, rows], more), _batch(given.candidates[:, rows], more)
            known = {"between": between, "upper": given.upper[rows], "rays": rays, "candidates": candidates}
            return [np.asarray(answer[0, :, :columns]) for answer in self._along_rays.run(None, known)]

        with ThreadPoolExecutor(usable_cores()) as cores:
            parts = cores.map(predicted, range(0, count, ROWS))
            rho, scale, valid = (np.concatenate(answers) for answers in zip(*parts, strict=True))
        return rho, scale, valid


def _batch(image: Array, more: int) -> Array:
    """A batch (1, C, H, W + more) of an image (C, H, W) whose first columns are repeated."""
    return np.concatenate([image, image[..., :more]], axis=-1)[None]
