"""The normal distributions transform (NDT; Biber & Strasser, IROS 2003; the paper's eq. 4-5)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from slam.data.cloud import Array
from slam.registration.gauss_newton import NOT_LOCKED, Linearisation, distortion_response, minimise, result
from slam.registration.observability import unobserved
from slam.registration.result import RegistrationResult
from slam.registration.voxels import NO_SCORES, VoxelGaussians, hash_table

COARSER_FACTORS = (2, 4)  # cell sizes relative to the finest, also used by a search: its poses are half a cell off
BLOCK_FACTOR = 4  # size of a block of evidence relative to the finest cells: adjacent points are one piece of evidence
MAX_BLOCK_WEIGHT = 0.5  # maximum weight of a block, in points
FEW_UPRIGHT = 50.0  # points that fit, in addition to those of a scan: the share of a dozen means nothing
MIN_LEVEL_OVERLAP = 0.28  # minimum overlap for a level to be used


class NdtTarget:
    """A map of Gaussians at one or more resolutions, coarse to fine, against which scans are registered.

    Args:
        cell_sizes: Cell sizes [m], coarse first.
        min_points: As in `VoxelGaussians`.
        max_points: As in `VoxelGaussians`.
        regularisation: As in `VoxelGaussians`.
        surfaces: As in `VoxelGaussians`.
        neighbours: Number of cells to which a point is matched: 1, its own, or 7, with the six face neighbours.
        kernel_scale: Scale of the Cauchy weight 1 / (1 + m / kernel_scale^2), m the squared Mahalanobis distance.
        max_iterations: Maximum number of iterations at the finest level; the other levels have half of it.

    Attributes:
        levels: The maps, coarse first.
        convergence_radius: Distance [m] within which two initial poses converge to the same pose.
    """

    def __init__(
        self,
        cell_sizes: Sequence[float],
        *,
        min_points: int = 5,
        max_points: int = 1000,
        regularisation: float = 0.003,
        surfaces: bool = False,
        neighbours: int = 1,
        kernel_scale: float = 1.0,
        max_iterations: int = 12,
    ) -> None:
        ceiling = cell_sizes[-1] if surfaces else math.inf
        self.levels = [
            VoxelGaussians(size, min_points, max_points, regularisation, surfaces, ceiling) for size in cell_sizes
        ]
        self.surfaces, self.neighbours, self.kernel_scale = surfaces, neighbours, kernel_scale
        self.max_iterations = max_iterations
        self.convergence_radius = float(cell_sizes[-1])

    def __len__(self) -> int:
        return len(self.levels[-1])

    def clear(self) -> None:
        """Remove all cells."""
        for level in self.levels:
            level.clear()

    def insert(self, xyz: Array, weight: Array, pose: Array) -> None:
        """Add points (N, 3) float32 with weights (N,) float32, transformed by `pose` (4, 4)."""
        for level in self.levels:
            level.insert(xyz, weight, pose)

    def evict(self, centre: Array, radius: float) -> None:
        """Remove the cells further than `radius` [m] from `centre` (3,)."""
        for level in self.levels:
            level.evict(centre, radius)

    def score(self, xyz: Array, weight: Array, pose: Array) -> float:
        """Return the paper's eq. 5 at the coarsest level, divided by the number of points; higher is better."""
        return self._linearise(self.levels[0], xyz, weight, pose, scored=True).score

    def scorer(self, xyz: Array, weight: Array, centre: Array) -> Callable[[Array], float]:
        """Return a function that scores poses (4, 4) of a scan; higher is better.

        With surface information the score is the evidence (see `kernels.evidence`) in the finest cells and in coarser
        cells made of them. Points are weighted by how much they constrain the horizontal direction that the scan
        constrains least: the edges of a road fit at every position along it.

        Args:
            xyz: Points (N, 3).
            weight: Their weights (N,).
            centre: Pose (4, 4) around which poses are scored.
        """
        if not self.surfaces:
            return partial(self.score, xyz, weight)
        finest = self.levels[-1]
        levels = [finest, *(finest.coarser(factor) for factor in COARSER_FACTORS)]
        relevance = _relevance(levels[1].support(xyz, weight, centre, self.kernel_scale)[0])
        scratch = hash_table(len(xyz))

        def evidence(pose: Array) -> float:
            block = BLOCK_FACTOR * finest.size
            return sum(
                level.evidence(xyz, weight, pose, relevance, block, MAX_BLOCK_WEIGHT, scratch) for level in levels
            )

        return evidence

    def align(self, xyz: Array, weight: Array, guess: Array, locked: Array = NOT_LOCKED) -> RegistrationResult:
        """Register points in the map, level by level, by Gauss-Newton on SE(3).

        Robust weights are recomputed in every step (IRLS). The coarse levels have half of the iterations: they only
        have to converge to within a cell of the finest level. The cells made for a new map may lead away from a good
        guess, often to where the rings coincide with those of the last scan; so the points are registered without them
        as well, and the pose with more evidence is returned.

        Args:
            xyz: Points (N, 3).
            weight: Their weights (N,).
            guess: Initial pose (4, 4).
            locked: Directions (K, 6), in the map's axes, along which no step is taken.
        """
        levels = self._levels_for(xyz, weight, guess)
        found = self._descend(levels, xyz, weight, guess, locked)
        if levels[0] in self.levels:
            return found
        score = self.scorer(xyz, weight, guess)
        direct = self._descend(self.levels, xyz, weight, guess, locked)
        return max(found, direct, key=lambda registration: score(registration.pose))

    def approach(self, xyz: Array, weight: Array, guess: Array) -> Array:
        """Return the pose (4, 4) at which `align` arrives, without its uncertainty: a step of a coarse to fine search.

        Args:
            xyz: Points (N, 3).
            weight: Their weights (N,).
            guess: Initial pose (4, 4).
        """
        pose = guess
        for level in self.levels:
            pose, _ = minimise(partial(self._linearise, level, xyz, weight), pose, self.max_iterations)
        return pose

    def _descend(
        self, levels: list[VoxelGaussians], xyz: Array, weight: Array, guess: Array, locked: Array
    ) -> RegistrationResult:
        """Register points in each of the levels, from coarse to fine, starting where the last one ended.

        The overlap is that of the finest level of the map, so that it can be compared from scan to scan.
        """
        pose, converged = guess, False
        for level in levels:
            limit = self.max_iterations if level is self.levels[-1] else self.max_iterations // 2
            pose, converged = minimise(partial(self._linearise, level, xyz, weight), pose, limit, locked)
        scores = np.zeros((len(xyz), 6))
        model = self._linearise(levels[-1], xyz, weight, pose, scores)
        found = result(model, pose, converged, xyz, scores, locked)
        if levels[-1] is self.levels[-1]:
            return found
        return replace(found, overlap=self.levels[-1].overlap(xyz, weight, pose))

    def _levels_for(self, xyz: Array, weight: Array, guess: Array) -> list[VoxelGaussians]:
        """Return the levels, coarse to fine, that enough points meet at the guess.

        If few points meet the coarsest level, the map is new: coarser levels, made of the finest, come first. The
        finest level is judged at the guess too: a sparse scan meets its own rings where the coarse level leads it.
        """
        if not self.surfaces:
            return self.levels
        levels = [level for level in self.levels if level.reaches_overlap(xyz, weight, guess, MIN_LEVEL_OVERLAP)]
        if self.levels[0] not in levels:
            levels = [self.levels[-1].coarser(factor) for factor in reversed(COARSER_FACTORS)] + levels
        return levels

    def distortion_response(self, xyz: Array, weight: Array, time: Array, found: RegistrationResult) -> Array:
        """Return how the pose follows a velocity error (6, 6), see `gauss_newton.distortion_response`."""
        model = self._linearise(self.levels[-1], xyz, weight * time, found.pose)
        return distortion_response(found.H, model.H, found.pose)

    def unobserved(self, xyz: Array, weight: Array, pose: Array, before: Array) -> Array:
        """Return the directions (K, 3) that points at `pose` do not constrain, see `observability.unobserved`.

        Without surface information there are none: noise and constraint are indistinguishable in a cell's covariance.
        """
        if not self.surfaces:
            return np.zeros((0, 3))
        return unobserved(self.levels[-1], xyz, weight, pose, self.kernel_scale, before)

    def _linearise(
        self,
        level: VoxelGaussians,
        xyz: Array,
        weight: Array,
        pose: Array,
        scores: Array = NO_SCORES,
        scored: bool = False,
    ) -> Linearisation:
        H, gradient, totals = level.normal_equations(
            xyz, weight, pose, self.neighbours, self.kernel_scale, scores, scored
        )
        robust, cost, inliers, score, met, total, upright_inliers, upright = totals
        # residuals per point; their whitened variance is 1 where the Gaussians describe the points correctly
        dimensions = 1.0 if self.surfaces else 3.0
        return Linearisation(
            H=H,
            gradient=gradient,
            variance=cost / max(dimensions * robust, 1e-9),
            inlier_ratio=inliers / max(met, 1e-9),
            upright_inlier_ratio=(upright_inliers + FEW_UPRIGHT) / (upright + FEW_UPRIGHT),
            overlap=met / max(total, 1e-9),
            score=score / max(total, 1e-9),
        )


def _relevance(support: Array) -> Array:
    """Relevance R (3, 3) for `kernels.evidence`.

    n^T R n is 1 for a surface that faces the least constrained horizontal direction, smaller for surfaces that face the
    other direction, in inverse proportion to their share, and 0 for the ground.
    """
    shares, axes = np.linalg.eigh(support[:2, :2])
    shares = np.maximum(shares, 1e-4)
    relevance = np.zeros((3, 3))
    relevance[:2, :2] = axes @ np.diag(shares[0] / shares) @ axes.T
    return relevance
