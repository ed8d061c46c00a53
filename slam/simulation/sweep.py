"""Motion of a LiDAR during a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.distortion import deskew
from slam.simulation.kernels import turned

STILL = np.eye(4)


@dataclass(frozen=True, eq=False)
class Sweep:
    """A sweep in S parts of equal duration, with constant velocity in each.

    Attributes:
        pose: (S, 4, 4) T_world_lidar in the middle of each part.
        motion: (S, 4, 4) T_start_end of each part.
    """

    pose: Array
    motion: Array

    @staticmethod
    def steady(pose: Array, motion: Array) -> Sweep:
        """Create a sweep of constant velocity: `pose` (4, 4) at mid-sweep, `motion` (4, 4) T_start_end."""
        return Sweep(pose[None], motion[None])

    @staticmethod
    def along(poses: Array) -> Sweep:
        """Create a sweep through S + 1 poses at equal intervals, from its start to its end."""
        motion = se3.inverse(poses[:-1]) @ poses[1:]
        middle = [start @ se3.scale(step, 0.5) for start, step in zip(poses[:-1], motion, strict=True)]
        return Sweep(np.array(middle), motion)

    def at(self, fraction: float) -> Array:
        """Return T_world_lidar (4, 4) at a fraction 0..1 of the sweep."""
        part = min(int(fraction * len(self.pose)), len(self.pose) - 1)
        return np.asarray(self.pose[part] @ se3.scale(self.motion[part], fraction * len(self.pose) - part - 0.5))

    def in_world(self, origin: Array, direction: Array, fraction: Array) -> tuple[Array, Array]:
        """Transform rays (N, 3) float32 from the LiDAR frame at fractions (N,) float32 of the sweep to the world."""
        parts = len(self.pose)
        if parts == 1:
            return _placed(origin, direction, fraction, self.pose[0], self.motion[0])
        part = np.minimum((fraction * parts).astype(np.int64), parts - 1)
        start, way = np.empty(origin.shape), np.empty_like(direction)
        for index in range(parts):
            at = np.flatnonzero(part == index)
            within = fraction[at] * np.float32(parts) - np.float32(index)
            moved = _placed(origin[at], direction[at], within, self.pose[index], self.motion[index])
            start[at], way[at] = moved
        return start, way


def _placed(origin: Array, direction: Array, fraction: Array, pose: Array, motion: Array) -> tuple[Array, Array]:
    start, tip = origin, origin + direction
    if not np.array_equal(motion, STILL):
        time = np.tile(fraction - np.float32(0.5), 2)  # in units of the sweep, from its middle
        both = PointCloud(np.concatenate([start, tip]), np.zeros(2 * len(start)), time=time)
        start, tip = np.split(deskew(both, se3.log(motion)).xyz, 2)
    rotation = pose[:3, :3].astype(np.float32)
    return turned(start, rotation) + pose[:3, 3], turned(tip - start, rotation)
