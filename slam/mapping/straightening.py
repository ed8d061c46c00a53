"""Keyframes registered anew, against those well behind them, for sparse rings bend a way up and down.

Rings on a road lie in the sensor's frame as they lay a moment ago, whatever the pitch. In a map that holds the scans
just before, a sparse scan meets its own rings again, and is drawn to the tilt that they were put there with. Held
against what was seen further back alone, it meets rings of other distances, which together are the ground.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.mapping.keyframes import Keyframe
from slam.registration.ndt import NdtTarget
from slam.registration.voxels import VoxelFilter

CELLS = (3.0, 1.5)  # m; finer ones know the rings' pattern again
VOXEL = 0.5  # m, thinning of what is registered and of what enters the map
RANGE, RADIUS = 80.0, 100.0  # m of points, and of the map around the sensor
MOST_MOVED, MOST_TURNED = 0.5, 2.0  # m, deg from one keyframe to the next: what is further off has lost its way


class Straightener:
    """Registers keyframe after keyframe against a map of those at least `held_back` [m] of way behind it."""

    def __init__(self, held_back: float) -> None:
        self._held_back = held_back
        self._thin = VoxelFilter(VOXEL, max_range=RANGE)
        self._map = NdtTarget(CELLS)
        self._waiting: deque[tuple[float, Array, Array]] = deque()  # way, points and pose of those too near as yet
        self._last: tuple[Array, Array] | None = None  # of the keyframe before: by the odometry, and registered anew

    def pose(self, keyframe: Keyframe) -> Array:
        """T_world_lidar (4, 4) of the next keyframe; the first one's is the odometry's."""
        cloud = keyframe.cloud.xyz
        xyz = self._thin(cloud, np.ones(len(cloud), np.float32))[0]
        while self._waiting and keyframe.way - self._waiting[0][0] >= self._held_back:
            _, points, pose = self._waiting.popleft()
            self._map.insert(points, np.ones(len(points), np.float32), pose)
        pose = keyframe.pose if self._last is None else self._registered(xyz, keyframe.pose, *self._last)
        self._waiting.append((keyframe.way, xyz, pose))
        self._last = keyframe.pose, pose
        return pose

    def _registered(self, xyz: Array, odometry: Array, odometry_before: Array, before: Array) -> Array:
        """The pose as the map has it, or, where that is far off or there is no map yet, as the odometry goes on."""
        guess = se3.normalized(before @ se3.inverse(odometry_before) @ odometry)
        self._map.evict(guess[:3, 3], RADIUS)
        if len(self._map) == 0:
            return guess
        found = self._map.align(xyz, np.ones(len(xyz), np.float32), guess).pose
        correction = se3.inverse(guess) @ found
        moved, turned = np.linalg.norm(correction[:3, 3]), np.rad2deg(se3.angle(correction))
        return se3.normalized(found) if moved < MOST_MOVED and turned < MOST_TURNED else guess
