"""Averages of points per voxel, the container of keyframes and of the map."""

from __future__ import annotations

from typing import Any

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.mapping import kernels

CAPACITY = 1 << 16  # initial number of voxels


class VoxelAverages:
    """Mean position, intensity and colour per voxel.

    A voxel takes 44 to 52 bytes, 16 more with colour; up to half as much again is reserved for growth.

    Args:
        size: Side of the cubic voxels [m].
        min_range: Points nearer to their sensor are left out [m].
        max_range: Points farther from their sensor are left out [m].
    """

    def __init__(self, size: float, min_range: float = 0.0, max_range: float = 1e9) -> None:
        self.size, self.min_range, self.max_range = size, min_range, max_range
        self._sums, self._keys = np.zeros((0, 7), np.float32), np.zeros(0, np.int64)
        self._count = self._clouds = 0
        self._reserve(CAPACITY)

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        """Remove all points; the memory is kept."""
        self._count = self._clouds = 0
        self._table[:] = kernels.FREE

    def insert(self, cloud: PointCloud, pose: Array, max_sigma: float = np.inf) -> None:
        """Add the points of a cloud in its sensor frame with sigmas up to `max_sigma`, transformed by `pose` (4, 4)."""
        if cloud.colour is not None and not self._coloured:
            self._sums = np.column_stack([self._sums, np.zeros((len(self._sums), 4), np.float32)])
        if self._count + len(cloud) > len(self._sums):
            self._reserve(max(3 * self._count // 2, self._count + 2 * len(cloud)))
        colour = np.zeros((0, 3), np.uint8) if cloud.colour is None else cloud.colour
        self._count = kernels.average_into(
            cloud.xyz, cloud.intensity, colour, cloud.sigma, np.float32(max_sigma), np.ascontiguousarray(pose),
            self.size, self.min_range, self.max_range,
            self._table, self._keys, self._sums, self._clouds, self._count,
        )  # fmt: skip
        self._clouds += 1

    def points(self) -> PointCloud:
        """Return one point per voxel, in the order of their first points.

        Points that no camera saw are black; without any coloured cloud there is no colour.
        """
        return self._points(np.ones(self._count, bool))

    def steps(self, step: float) -> tuple[Array, Array, Array | None]:
        """Return the points in whole numbers, in the same order, without those beyond the range of int16.

        Args:
            step: Resolution of the coordinates [m].

        Returns:
            Coordinates (K, 3) int16 in `step`, intensities (K,) uint8 in 1 / 255, and colours (K, 3) uint8 or None.
        """
        xyz, intensity, colour = kernels.steps(self._sums, self._keys, self._count, self.size, np.float32(step))
        return xyz, intensity, colour if self._coloured else None

    def state(self) -> dict[str, Any]:
        """Return the voxels, for `restore`."""
        return {"sums": self._sums[: self._count], "keys": self._keys[: self._count], "clouds": self._clouds}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue with the voxels of another one with the same settings."""
        self._sums, self._keys, self._clouds = state["sums"], state["keys"], state["clouds"]
        self._count = len(self._keys)
        self._reserve(max(self._count, CAPACITY))

    def _points(self, kept: Array) -> PointCloud:
        """Points of the voxels `kept` (C,) bool."""
        xyz, intensity, colour = kernels.averages(self._sums, self._keys, kept, self.size)
        return PointCloud(xyz, intensity, colour=colour if self._coloured else None)

    @property
    def _coloured(self) -> bool:
        return self._sums.shape[1] > 7

    def _reserve(self, capacity: int) -> None:
        """Reserve memory for `capacity` voxels, and keep the present ones."""
        for name in ("_sums", "_keys"):
            old = getattr(self, name)
            new = np.zeros((capacity, *old.shape[1:]), old.dtype)
            new[: self._count] = old[: self._count]
            setattr(self, name, new)
        self._table = np.full(1 << (2 * capacity - 1).bit_length(), kernels.FREE, np.int32)
        kernels.rehash(self._keys, self._count, self._table)
