"""One global map of all that was seen: a point a voxel, the average of those that fell into it."""

from __future__ import annotations

import numpy as np

from slam.config import MapSettings
from slam.data.cloud import Array, PointCloud
from slam.registration import kernels
from slam.registration.voxels import hash_table


class GlobalMap:
    """Grows with the area that is seen, not with the number of scans: about 50 bytes a voxel."""

    def __init__(self, settings: MapSettings) -> None:
        self.settings = settings
        self._count = 0
        self._sums, self._cell_keys = np.zeros((0, 5), np.float32), np.zeros(0, np.int64)
        self._reserve(1 << 16)

    def __len__(self) -> int:
        return self._count

    def insert(self, cloud: PointCloud, pose: Array) -> None:
        """Add a scan: deskewed points in the sensor's frame, seen from `pose` (4, 4), T_world_lidar."""
        if self._count + len(cloud) > len(self._sums):
            self._reserve(2 * (self._count + len(cloud)))
        settings = self.settings
        self._count = kernels.average_into(
            cloud.xyz, cloud.intensity, pose, settings.voxel_size, settings.min_range, settings.max_range,
            self._keys, self._slots, self._sums, self._cell_keys, self._count,
        )  # fmt: skip

    def points(self) -> PointCloud:
        """The map so far, in the world's frame."""
        xyz, intensity = kernels.averages(self._sums, self._cell_keys, self._count, self.settings.voxel_size)
        return PointCloud(xyz.astype(np.float32), intensity)

    def _reserve(self, capacity: int) -> None:
        sums, cell_keys = np.zeros((capacity, 5), np.float32), np.zeros(capacity, np.int64)
        sums[: self._count], cell_keys[: self._count] = self._sums[: self._count], self._cell_keys[: self._count]
        self._sums, self._cell_keys = sums, cell_keys
        self._keys, self._slots = hash_table(capacity)
        kernels.rehash(cell_keys, self._count, self._keys, self._slots)
