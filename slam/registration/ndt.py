"""The normal distributions transform: points against Gaussians (Biber & Strasser, IROS 2003; the paper's eq. 4-5)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from slam.data.cloud import Array
from slam.registration.gauss_newton import Linearisation, minimise, result
from slam.registration.result import RegistrationResult
from slam.registration.voxels import NO_SCORES, VoxelGaussians
from slam.settings import OdometrySettings


class NdtTarget:
    """A map of Gaussians at one or more resolutions, coarse to fine, that scans are registered against.

    Args:
        cell_sizes: [m], coarse first; by default those of the settings.
        settings: Of the Gaussians (see `VoxelGaussians`), of Cauchy's weight 1 / (1 + m / kernel^2) on the Mahalanobis
            distance squared m, and of the iterations.
    """

    def __init__(self, cell_sizes: Sequence[float] | None = None, settings: OdometrySettings | None = None) -> None:
        settings = settings or OdometrySettings()
        sizes = settings.cell_sizes if cell_sizes is None else cell_sizes
        self.levels = [VoxelGaussians(size, settings.min_points, settings.max_points, settings.floor) for size in sizes]
        self.neighbours, self.kernel = settings.neighbours, settings.kernel
        self.max_iterations = settings.max_iterations

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

    def align(self, xyz: Array, weight: Array, guess: Array) -> RegistrationResult:
        """Pose of the points (N, 3) in the map, from `guess` (4, 4), level by level, by Gauss-Newton on SE(3).

        Robust weights are renewed in every step (IRLS). The coarse levels get half of the iterations: they only
        have to bring the finest one within reach.
        """
        pose, converged = guess, False
        for level in self.levels:
            limit = self.max_iterations if level is self.levels[-1] else self.max_iterations // 2
            linearise = partial(self._linearise, level, xyz, weight)
            pose, converged = minimise(linearise, pose, limit)
        scores = np.zeros((len(xyz), 6))
        model = self._linearise(self.levels[-1], xyz, weight, pose, scores)
        return result(model, pose, converged, xyz, scores)

    def _linearise(
        self, level: VoxelGaussians, xyz: Array, weight: Array, pose: Array, scores: Array = NO_SCORES
    ) -> Linearisation:
        H, gradient, totals = level.normal_equations(xyz, weight, pose, self.neighbours, self.kernel, scores)
        robust, cost, inliers, score, met, total = totals
        return Linearisation(
            H=H,
            gradient=gradient,
            # three residuals a point, whitened: 1 where the Gaussians tell the truth about the points
            variance=cost / max(3.0 * robust, 1e-9),
            inlier_ratio=inliers / max(met, 1e-9),
            overlap=met / max(total, 1e-9),
            score=score / max(total, 1e-9),
        )
