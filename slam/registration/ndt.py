"""The normal distributions transform: points against Gaussians (Biber & Strasser, IROS 2003; the paper's eq. 4-5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from slam.data.cloud import Array
from slam.registration.gauss_newton import NOTHING, Linearisation, minimise, result
from slam.registration.observability import unobserved
from slam.registration.result import RegistrationResult
from slam.registration.voxels import NO_SCORES, VoxelGaussians, hash_table

COARSER = (2, 4)  # times the finest cells: where a search looks as well, for poses are half a cell off
BLOCK = 4  # times the finest cells: what lies so near together is one piece of evidence
MOST = 0.5  # points' worth that a block counts at most
MET = 0.28  # share of the points that a level must meet to be of use


class NdtTarget:
    """A map of Gaussians at one or more resolutions, coarse to fine, that scans are registered against.

    Args:
        cell_sizes: [m], coarse first.
        min_points, max_points, floor, surfaces: Of the Gaussians, see `VoxelGaussians`.
        neighbours: Gaussians that a point is held against: 1, its own cell's, or 7.
        kernel: Of Cauchy's weight 1 / (1 + m / kernel^2) on the Mahalanobis distance squared m.
        max_iterations: At the finest level; the others get half of them.
    """

    def __init__(
        self,
        cell_sizes: Sequence[float],
        *,
        min_points: int = 5,
        max_points: int = 1000,
        floor: float = 0.003,
        surfaces: bool = False,
        neighbours: int = 1,
        kernel: float = 1.0,
        max_iterations: int = 12,
    ) -> None:
        self.levels = [VoxelGaussians(size, min_points, max_points, floor, surfaces) for size in cell_sizes]
        self.surfaces, self.neighbours, self.kernel = surfaces, neighbours, kernel
        self.max_iterations = max_iterations
        self.reach = float(cell_sizes[-1])  # m: poses so near to each other are led to the same one

    def __len__(self) -> int:
        return len(self.levels[-1])

    def clear(self) -> None:
        for level in self.levels:
            level.clear()

    def insert(self, xyz: Array, weight: Array, pose: Array) -> None:
        """Add points (N, 3) float32 with weights (N,) float32, moved by `pose` (4, 4)."""
        for level in self.levels:
            level.insert(xyz, weight, pose)

    def evict(self, centre: Array, radius: float) -> None:
        """Forget what is further than `radius` [m] from `centre` (3,)."""
        for level in self.levels:
            level.evict(centre, radius)

    def score(self, xyz: Array, weight: Array, pose: Array) -> float:
        """The paper's eq. 5 at the coarsest level, divided by the number of points: higher is better."""
        return self._linearise(self.levels[0], xyz, weight, pose).score

    def scorer(self, xyz: Array, weight: Array, centre: Array) -> Callable[[Array], float]:
        """What tells poses (4, 4) of the points (N, 3) around `centre` apart: higher is better.

        Where cells hold surfaces, it is the evidence (see `kernels.evidence`) of the finest cells and of coarser ones
        made of them. Points count by how much they tell in the horizontal direction that the scan as a whole tells
        least: along a road its edges fit wherever the car is.
        """
        if not self.surfaces:
            return partial(self.score, xyz, weight)
        finest = self.levels[-1]
        levels = [finest, *(finest.coarser(factor) for factor in COARSER)]
        relevance = _relevance(levels[1].support(xyz, weight, centre, self.kernel)[0])
        scratch = hash_table(len(xyz))

        def evidence(pose: Array) -> float:
            block = BLOCK * finest.size
            return sum(level.evidence(xyz, weight, pose, relevance, block, MOST, scratch) for level in levels)

        return evidence

    def align(self, xyz: Array, weight: Array, guess: Array, locked: Array = NOTHING) -> RegistrationResult:
        """Pose of the points (N, 3) in the map, from `guess` (4, 4), level by level, by Gauss-Newton on SE(3).

        Robust weights are renewed in every step (IRLS). The coarse levels get half of the iterations: they only
        have to bring the finest one within reach. No step is taken along `locked` (K, 6), in the map's axes.
        """
        pose, converged, deciding = guess, False, self.levels[-1]
        model = self._linearise(self.levels[0], xyz, weight, guess)
        for level in (*self._begun(model), *self.levels):
            linearise = partial(self._linearise, level, xyz, weight)
            model = model if level is self.levels[0] and pose is guess else linearise(pose)
            if self.surfaces and level in self.levels and model.overlap < MET:
                continue
            deciding = level
            limit = self.max_iterations if level is self.levels[-1] else self.max_iterations // 2
            pose, converged = minimise(linearise, pose, model, limit, locked)
        scores = np.zeros((len(xyz), 6))
        model = self._linearise(deciding, xyz, weight, pose, scores)
        return result(model, pose, converged, xyz, scores)

    def _begun(self, model: Linearisation) -> list[VoxelGaussians]:
        """Coarser levels made of the finest one, where few points meet the coarse level: the map has just begun."""
        if not self.surfaces or model.overlap >= MET:
            return []
        return [self.levels[-1].coarser(factor) for factor in reversed(COARSER)]

    def unobserved(self, xyz: Array, weight: Array, pose: Array, before: Array) -> Array:
        """Directions (K, 3) that points at `pose` do not hold, as `observability.unobserved` finds them; none where
        cells hold by their covariance, in which noise cannot be told from what holds."""
        if not self.surfaces:
            return np.zeros((0, 3))
        return unobserved(self.levels[-1], xyz, weight, pose, self.kernel, before)

    def _linearise(
        self, level: VoxelGaussians, xyz: Array, weight: Array, pose: Array, scores: Array = NO_SCORES
    ) -> Linearisation:
        H, gradient, totals = level.normal_equations(xyz, weight, pose, self.neighbours, self.kernel, scores)
        robust, cost, inliers, score, met, total = totals
        # residuals a point, whitened: 1 where the Gaussians tell the truth about the points
        dimensions = 1.0 if self.surfaces else 3.0
        return Linearisation(
            H=H,
            gradient=gradient,
            variance=cost / max(dimensions * robust, 1e-9),
            inlier_ratio=inliers / max(met, 1e-9),
            overlap=met / max(total, 1e-9),
            score=score / max(total, 1e-9),
        )


def _relevance(support: Array) -> Array:
    """(3, 3) R for `kernels.evidence`: n^T R n is 1 for a surface that faces the weakest horizontal direction, less for
    those that face the other by as much as more of them do, 0 for the ground."""
    shares, axes = np.linalg.eigh(support[:2, :2])
    shares = np.maximum(shares, 1e-4)
    relevance = np.zeros((3, 3))
    relevance[:2, :2] = axes @ np.diag(shares[0] / shares) @ axes.T
    return relevance
