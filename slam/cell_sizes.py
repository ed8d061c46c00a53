"""Cells, thinning and the nearest points that count, from how far the first scan sees: a street, or a corridor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.registration.voxels import VoxelFilter
from slam.settings import OdometrySettings

EVEN = 1.0  # m, thinning before the range is taken: near walls would count for their many points
NEAR = 0.5  # m; nearer points say nothing about the scene
SHARE = 1 / 8  # of the median range: the finest cells. Streets 15 to 42 m, corridors 4 to 9 m
LEAST, MOST = 0.4, 1.0  # m; smaller cells are empty, larger ones hold more than one surface
COARSE, THINNING, MAP_THINNING, MIN_RANGE = 1.5, 0.75, 0.4, 2.5  # times the finest cells


@dataclass(frozen=True)
class Sizes:
    """Of the odometry, all in metres: cells coarse to fine, thinning of what is registered and of what enters the map,
    and the nearest points that count."""

    cell_sizes: tuple[float, ...]
    voxel_size: float
    map_voxel_size: float
    min_range: float


def sized(settings: OdometrySettings, xyz: Array) -> Sizes:
    """The settings' sizes, and for those that are None what suits a drive that begins with the scan (N, 3) float32."""
    evenly = VoxelFilter(EVEN, NEAR, settings.max_range)(xyz, np.ones(len(xyz), np.float32))[0]
    ranges = np.linalg.norm(evenly, axis=1) if len(evenly) else np.array([settings.max_range])
    finest = float(np.clip(SHARE * np.median(ranges), LEAST, MOST))
    cells = settings.cell_sizes or (COARSE * finest, finest)
    finest = cells[-1]
    return Sizes(
        cell_sizes=cells,
        voxel_size=settings.voxel_size or THINNING * finest,
        map_voxel_size=settings.map_voxel_size or MAP_THINNING * finest,
        min_range=MIN_RANGE * finest if settings.min_range is None else settings.min_range,
    )
