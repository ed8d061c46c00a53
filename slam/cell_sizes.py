"""Cell sizes, voxel sizes and minimum range, from the ranges of the first scan: of a street, or of a corridor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.registration.voxels import VoxelFilter
from slam.settings import OdometrySettings

VOXEL_SIZE = 1.0  # m, for the median range: otherwise near walls with many points would dominate
NEAR = 0.5  # m; nearer points belong to the platform
SHARE = 1 / 8  # of the finest cells to the median range, which is 15 to 42 m in streets and 4 to 9 m in corridors
MIN_CELL, MAX_CELL = 0.4, 1.0  # m; smaller cells are empty, larger cells contain several surfaces
COARSE_CELLS, VOXELS, MAP_VOXELS, MIN_RANGE = 1.5, 0.75, 0.4, 2.5  # relative to the finest cells


@dataclass(frozen=True)
class Sizes:
    """Sizes of the odometry, all in metres.

    Attributes:
        cell_sizes: Sizes of the map's cells, coarse to fine.
        voxel_size: Voxel size of the points that are registered.
        map_voxel_size: Voxel size of the points that are inserted into the map.
        min_range: Range below which points are removed.
    """

    cell_sizes: tuple[float, ...]
    voxel_size: float
    map_voxel_size: float
    min_range: float


def choose_sizes(settings: OdometrySettings, xyz: Array) -> Sizes:
    """Return the settings' sizes; those that are None are chosen from the first scan (N, 3) float32."""
    thinned = VoxelFilter(VOXEL_SIZE, NEAR, settings.max_range)(xyz, np.ones(len(xyz), np.float32))[0]
    ranges = np.linalg.norm(thinned, axis=1) if len(thinned) else np.array([settings.max_range])
    finest = float(np.clip(SHARE * np.median(ranges), MIN_CELL, MAX_CELL))
    cells = settings.cell_sizes or (COARSE_CELLS * finest, finest)
    finest = cells[-1]
    return Sizes(
        cell_sizes=cells,
        voxel_size=settings.voxel_size or VOXELS * finest,
        map_voxel_size=settings.map_voxel_size or MAP_VOXELS * finest,
        min_range=MIN_RANGE * finest if settings.min_range is None else settings.min_range,
    )
