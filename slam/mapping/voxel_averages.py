"""Points averaged by the cubic voxel that they fall into: what keyframes and the map are gathered in."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.mapping import kernels

CAPACITY = 1 << 16  # voxels to begin with


class VoxelAverages:
    """Mean position, intensity and colour of each voxel of `size` [m]; grows with the space that is seen.

    Points nearer to their sensor than `min_range` or further than `max_range` [m] are left out. A voxel takes 42 to 50
    bytes, 16 more with colour; up to half as much again is reserved for growth.
    """

    def __init__(self, size: float, min_range: float = 0.0, max_range: float = 1e9) -> None:
        self.size, self.min_range, self.max_range = size, min_range, max_range
        self._sums, self._keys = np.zeros((0, 5), np.float32), np.zeros(0, np.int64)
        self._seen, self._last = np.zeros(0, np.uint16), np.zeros(0, np.int32)
        self._count = self._clouds = 0
        self._reserve(CAPACITY)

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        """Forget all, and keep the memory for what comes."""
        self._count = self._clouds = 0
        self._table[:] = kernels.FREE

    def insert(self, cloud: PointCloud, pose: Array) -> None:
        """Add a cloud in its sensor's frame, moved by `pose` (4, 4)."""
        if cloud.colour is not None and not self._coloured:
            self._sums = np.column_stack([self._sums, np.zeros((len(self._sums), 4), np.float32)])
        if self._count + len(cloud) > len(self._sums):
            self._reserve(max(3 * self._count // 2, self._count + len(cloud)))
        colour = np.zeros((0, 3), np.uint8) if cloud.colour is None else cloud.colour
        self._count = kernels.average_into(
            cloud.xyz, cloud.intensity, colour, pose, self.size, self.min_range, self.max_range,
            self._table, self._keys, self._sums, self._seen, self._last, self._clouds, self._count,
        )  # fmt: skip
        self._clouds += 1

    def points(self) -> PointCloud:
        """A point a voxel, in the order in which they were first met.

        Points that no camera saw are black; there is no colour at all where no cloud had any.
        """
        return self._points(np.ones(self._count, bool))

    def _points(self, kept: Array) -> PointCloud:
        """Of the voxels `kept` (C,) bool."""
        xyz, intensity, colour = kernels.averages(self._sums, self._keys, kept, self.size)
        return PointCloud(xyz, intensity, colour=colour if self._coloured else None)

    @property
    def _coloured(self) -> bool:
        return self._sums.shape[1] > 5

    def _reserve(self, capacity: int) -> None:
        """Room for so many voxels, with those there are."""
        for name in ("_sums", "_keys", "_seen", "_last"):
            old = getattr(self, name)
            new = np.zeros((capacity, *old.shape[1:]), old.dtype)
            new[: self._count] = old[: self._count]
            setattr(self, name, new)
        self._table = np.full(1 << (2 * capacity - 1).bit_length(), kernels.FREE, np.int32)
        kernels.rehash(self._keys, self._count, self._table)
