"""Space cut into cubic cells: thinning a cloud, and a bounded map with one Gaussian a cell."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.registration import kernels

NO_SCORES, AXES = np.zeros((0, 6)), np.eye(3)


def hash_table(entries: int) -> Array:
    """An empty hash table (S, 2) int64, see `kernels`, at most half full with that many entries."""
    return np.full((1 << max(10, (2 * entries - 1).bit_length()), 2), kernels.EMPTY)


class VoxelFilter:
    """Thins clouds to one point a cell: the weighted centroid. Keeps its scratch memory from scan to scan."""

    def __init__(self, size: float, min_range: float = 0.0, max_range: float = 1e9) -> None:
        self.size, self.min_range, self.max_range = size, min_range, max_range
        self._scratch = hash_table(1)

    def __call__(self, xyz: Array, weight: Array) -> tuple[Array, Array, Array]:
        """Points (N, 3) and weights (N,), float32 -> centroids (M, 3), mean weights (M,), first point of each (M,)."""
        while True:
            *thinned, fits = kernels.downsample(xyz, weight, self.size, self.min_range, self.max_range, self._scratch)
            if fits:
                return thinned[0], thinned[1], thinned[2]
            self._scratch = hash_table(len(self._scratch))


class VoxelGaussians:
    """Gaussians of the points seen in each cubic cell, hashed; grows as needed, forgets what is far away.

    min_points  cells that saw fewer have no Gaussian yet
    max_points  cells that saw so many are not changed any more (a standing car would otherwise sharpen its own noise,
                and each scan costs time)
    floor       share of a covariance's trace that is added to its diagonal, so that planes stay invertible
    surfaces    a point is held along the directions in which the cell's surface is thin; False: by the whole inverse
                covariance of the cell, as in the paper
    """

    def __init__(self, size: float, min_points: int, max_points: int, floor: float, surfaces: bool = False) -> None:
        self.size, self.min_points, self.max_points, self.floor = size, min_points, max_points, floor
        self.surfaces = surfaces
        self._pose = np.eye(4)  # of the last points that were added
        self._sums, self._gaussians = np.zeros((0, 11)), np.zeros((0, kernels.GAUSSIAN))
        self._cell_keys = np.zeros(0, np.int64)
        self.clear()

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        self._count = 0
        self._allocate(max(4096, len(self._sums)))

    def insert(self, xyz: Array, weight: Array, pose: Array) -> None:
        """Add points (N, 3) float32 with weights (N,) float32, seen from and moved by `pose` (4, 4)."""
        if self._count + len(xyz) > len(self._sums):
            self._allocate(2 * (self._count + len(xyz)))
        self._pose = pose
        self._count = kernels.insert(
            xyz, weight, pose, self.size, self.min_points, self.max_points, self.floor, self.surfaces,
            self._table, self._sums, self._gaussians, self._cell_keys, self._count,
        )  # fmt: skip

    def evict(self, centre: Array, radius: float) -> None:
        """Forget the cells further than `radius` [m] from `centre` (3,)."""
        self._count = kernels.evict(
            centre, radius, self._table, self._sums, self._gaussians, self._cell_keys, self._count
        )

    def coarser(self, factor: int) -> VoxelGaussians:
        """The same points in cells `factor` times as large."""
        coarse = VoxelGaussians(self.size * factor, self.min_points, self.max_points, self.floor, surfaces=True)
        if self._count > len(coarse._sums):
            coarse._allocate(self._count)
        coarse._pose = self._pose
        coarse._count = kernels.merge(
            self._sums, self._count, coarse.size, self.min_points, self.floor, self._pose,
            coarse._table, coarse._sums, coarse._gaussians, coarse._cell_keys,
        )  # fmt: skip
        return coarse

    def normal_equations(
        self, xyz: Array, weight: Array, pose: Array, neighbours: int, kernel: float, scores: Array = NO_SCORES
    ) -> tuple[Array, Array, Array]:
        """See `kernels.normal_equations`."""
        return kernels.normal_equations(
            xyz, weight, pose, self.size, neighbours, kernel, self._table, self._gaussians, scores
        )

    def support(self, xyz: Array, weight: Array, pose: Array, kernel: float, axes: Array = AXES) -> tuple[Array, Array]:
        """See `kernels.support`."""
        return kernels.support(xyz, weight, pose, self.size, kernel, axes, self._table, self._gaussians)

    def evidence(
        self, xyz: Array, weight: Array, pose: Array, relevance: Array, block: float, most: float, scratch: Array
    ) -> float:
        """See `kernels.evidence`."""
        return kernels.evidence(
            xyz, weight, pose, relevance, self.size, block, most, self._table, self._gaussians, scratch
        )

    def _allocate(self, capacity: int) -> None:
        """Room for so many cells, with those there are."""
        old = (self._sums, self._gaussians, self._cell_keys)
        self._sums, self._gaussians = np.zeros((capacity, 11)), np.zeros((capacity, kernels.GAUSSIAN))
        self._cell_keys = np.zeros(capacity, np.int64)
        for new, values in zip((self._sums, self._gaussians, self._cell_keys), old, strict=True):
            new[: self._count] = values[: self._count]
        self._table = hash_table(capacity)
        kernels.rehash(self._cell_keys, self._count, self._table)
