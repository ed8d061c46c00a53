"""Voxel grids: downsampling of clouds, and a bounded map with one Gaussian per cell."""

from __future__ import annotations

import math

import numpy as np

from slam.data.cloud import Array
from slam.registration import kernels

NO_SCORES = np.zeros((0, 6))
NO_TIMES = np.zeros(0, np.float32)


def hash_table(entries: int) -> Array:
    """Return an empty hash table (S,) int32, see `kernels`, at most half full with this number of entries."""
    return np.full(1 << max(10, (2 * entries - 1).bit_length()), kernels.EMPTY)


class VoxelFilter:
    """Downsamples clouds to the weighted centroid of each cell. Scratch memory is reused from scan to scan.

    Args:
        size: Size of the cells [m].
        min_range: Range [m] below which points are removed.
        max_range: Range [m] above which points are removed.
    """

    def __init__(self, size: float, min_range: float = 0.0, max_range: float = 1e9) -> None:
        self.size, self.min_range, self.max_range = size, min_range, max_range
        self._scratch = hash_table(1)

    def __call__(self, xyz: Array, weight: Array, time: Array | None = None) -> tuple[Array, Array, Array]:
        """Downsample a cloud.

        Args:
            xyz: Points (N, 3) float32.
            weight: Their weights (N,) float32.
            time: Their times (N,) float32 [s], or None.

        Returns:
            Centroids (M, 3), mean weights (M,) and mean times (M,), 0 without times; in the order of the first points.
        """
        limits = self.size, self.min_range, self.max_range
        while True:
            *thinned, fits = kernels.downsample(xyz, weight, NO_TIMES if time is None else time, *limits, self._scratch)
            if fits:
                return thinned[0], thinned[1], thinned[2]
            self._scratch = hash_table(len(self._scratch))


class VoxelGaussians:
    """Gaussians of the points in each cubic cell, in a hash table that grows as needed.

    Args:
        size: Size of the cells [m].
        min_points: Minimum number of points for a Gaussian.
        max_points: Number of points after which a cell is not updated any more (otherwise a standing car sharpens its
            own noise, and each scan costs time).
        regularisation: Share of a covariance's trace that is added to its diagonal, so that flat cells stay invertible.
        surfaces: A point is constrained along the directions in which the cell's surface is thin; False: by the full
            inverse covariance of the cell, as in the paper.
        ceiling: Height above the sensor [m], along the map's z axis, from which points have cells of their own, so that
            a floor is not matched to the ceiling beneath it. All other surfaces are met from any height.
    """

    def __init__(
        self,
        size: float,
        min_points: int,
        max_points: int,
        regularisation: float,
        surfaces: bool = False,
        ceiling: float = math.inf,
    ) -> None:
        self.size, self.min_points, self.max_points, self.regularisation = size, min_points, max_points, regularisation
        self.surfaces, self.ceiling = surfaces, ceiling
        self._pose = np.eye(4)  # of the last scan inserted
        self._sums, self._gaussians = np.zeros((0, kernels.SUMS)), np.zeros((0, kernels.GAUSSIAN))
        self._cell_keys = np.zeros(0, np.int64)
        self.clear()

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        """Remove all cells."""
        self._count = 0
        self._allocate(max(4096, len(self._sums)))

    def insert(self, xyz: Array, weight: Array, pose: Array) -> None:
        """Add points (N, 3) float32 with weights (N,) float32, transformed by the sensor's pose (4, 4)."""
        if self._count + len(xyz) > len(self._sums):
            self._allocate(3 * (self._count + len(xyz)) // 2)
        self._pose = pose
        self._count = kernels.insert(
            xyz, weight, pose, self.size, self.ceiling, self.min_points, self.max_points, self.regularisation,
            self.surfaces, self._table, self._sums, self._gaussians, self._cell_keys, self._count,
        )  # fmt: skip

    def compact(self) -> None:
        """Reduce the memory to that of the cells, for maps that are kept; `insert` is not possible afterwards."""
        self._gaussians, self._sums = self._gaussians[: self._count].copy(), np.zeros((0, kernels.SUMS))
        self._table = hash_table(self._count)
        self._cell_keys = self._cell_keys[: self._count].copy()
        kernels.rehash(self._cell_keys, self._count, self._table)

    def evict(self, centre: Array, radius: float) -> None:
        """Remove the cells further than `radius` [m] from `centre` (3,)."""
        self._count = kernels.evict(
            centre, radius, self.size, self._table, self._sums, self._gaussians, self._cell_keys, self._count
        )

    def coarser(self, factor: int) -> VoxelGaussians:
        """Return the same points in cells `factor` times as large."""
        coarse = VoxelGaussians(
            self.size * factor, self.min_points, self.max_points, self.regularisation, True, self.ceiling
        )
        if self._count > len(coarse._sums):
            coarse._allocate(self._count)
        coarse._pose = self._pose
        coarse._count = kernels.merge(
            self._sums, self._cell_keys, self._count, self.size,
            coarse.size, self.min_points, self.regularisation, self._pose, coarse._table, coarse._sums,
            coarse._gaussians, coarse._cell_keys,
        )  # fmt: skip
        return coarse

    def normal_equations(
        self,
        xyz: Array,
        weight: Array,
        pose: Array,
        neighbours: int,
        kernel: float,
        scores: Array = NO_SCORES,
        scored: bool = False,
    ) -> tuple[Array, Array, Array]:
        """Return H, gradient and sums of one NDT linearisation, see `kernels.normal_equations`."""
        return kernels.normal_equations(
            xyz, weight, pose, self.size, self.ceiling, neighbours, kernel,
            self._table, self._cell_keys, self._gaussians, scores, scored,
        )  # fmt: skip

    def fits(self, xyz: Array, poses: Array) -> Array:
        """Return score and number of inliers (P, 2) of points (N, 3) at poses (P, 4, 4), see `kernels.fits`."""
        return kernels.fits(xyz, poses, self.size, self.ceiling, self._table, self._cell_keys, self._gaussians)

    def overlap(self, xyz: Array, weight: Array, pose: Array) -> float:
        """Return the share of the points that meet a Gaussian, see `kernels.overlap`."""
        return kernels.overlap(
            xyz, weight, pose, self.size, self.ceiling, self._table, self._cell_keys, self._gaussians
        )

    def reaches_overlap(self, xyz: Array, weight: Array, pose: Array, share: float) -> bool:
        """Return whether at least a share of the points meets a Gaussian, see `kernels.overlap`."""
        return kernels.reaches_overlap(
            xyz, weight, pose, self.size, self.ceiling, share, self._table, self._cell_keys, self._gaussians
        )

    def support(self, xyz: Array, weight: Array, pose: Array, kernel: float) -> tuple[Array, Array, Array]:
        """Return the directions that the surfaces face, see `kernels.support`."""
        return kernels.support(
            xyz, weight, pose, self.size, self.ceiling, kernel, self._table, self._cell_keys, self._gaussians
        )

    def facing(self, cells: Array, weight: Array, axes: Array) -> Array:
        """Return the part (K,) of the surfaces that face each of the axes (K, 3), see `kernels.facing`."""
        return kernels.facing(cells, weight, axes, self._gaussians)

    def evidence(
        self, xyz: Array, weight: Array, pose: Array, relevance: Array, block: float, max_weight: float, scratch: Array
    ) -> float:
        """Return the evidence for a pose, see `kernels.evidence`."""
        return kernels.evidence(
            xyz,
            weight,
            pose,
            relevance,
            self.size,
            self.ceiling,
            block,
            max_weight,
            self._table,
            self._cell_keys,
            self._gaussians,
            scratch,
        )

    def _allocate(self, capacity: int) -> None:
        """Grow to `capacity` cells, and keep the existing ones."""
        old = (self._sums, self._gaussians, self._cell_keys)
        self._sums, self._gaussians = np.zeros((capacity, kernels.SUMS)), np.zeros((capacity, kernels.GAUSSIAN))
        self._cell_keys = np.zeros(capacity, np.int64)
        for new, values in zip((self._sums, self._gaussians, self._cell_keys), old, strict=True):
            new[: self._count] = values[: self._count]
        self._table = hash_table(
            2 * capacity // 3
        )  # at most three quarters full, if each point makes a cell of its own
        kernels.rehash(self._cell_keys, self._count, self._table)
