"""Cells, thinning and the nearest points that count, from how wide the scene is: a street, or a corridor."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.registration.voxels import VoxelFilter
from slam.settings import OdometrySettings

EVEN = 1.0  # m, thinning before the range is taken: near walls would count for their many points
NEAR = 0.5  # m; nearer points say nothing about the scene
SHARE = 1 / 8  # of the median range: the finest cells. Streets 15 to 42 m, corridors 4 to 9 m
LEAST, MOST = 0.4, 1.0  # m; smaller cells are empty, larger ones hold more than one surface
COARSE, THINNING, MAP_THINNING, MIN_RANGE = 1.5, 0.75, 0.4, 2.5  # times the finest cells


def sized(settings: OdometrySettings, xyz: Array) -> OdometrySettings:
    """The settings with all sizes filled in, for a drive that begins with the scan (N, 3) float32, N > 0."""
    near_and_far = VoxelFilter(EVEN, NEAR, settings.max_range)(xyz, np.ones(len(xyz), np.float32))[0]
    ranges = np.linalg.norm(near_and_far, axis=1) if len(near_and_far) else np.array([settings.max_range])
    finest = float(np.clip(SHARE * np.median(ranges), LEAST, MOST))
    if settings.cell_sizes is not None:
        finest = settings.cell_sizes[-1]
    chosen = {
        "cell_sizes": (COARSE * finest, finest),
        "voxel_size": THINNING * finest,
        "map_voxel_size": MAP_THINNING * finest,
        "min_range": MIN_RANGE * finest,
    }
    return settings.model_copy(update={k: v for k, v in chosen.items() if getattr(settings, k) is None})
