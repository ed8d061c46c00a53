"""Detection of scans whose points are already in the world frame."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.data.problem import Problem

EVERY = 16  # every 16th point suffices for the centre
FARTHEST = 30.0  # maximum motion of the centre for a standing LiDAR, as traffic passes [m]
STANDING = 0.1  # maximum motion by the odometry, as a share of the centre's, if the points are in the world frame
JUMP = 0.25  # maximum share of the centre's motion in one step; more is a scene change, such as a door that opens


def centre(xyz: Array) -> Array:
    """Return the median position (2,) of points (N, 3), seen from above; NaN without points."""
    if not len(xyz):
        return np.full(2, np.nan)
    columns = np.ascontiguousarray(xyz[::EVERY, :2].T)  # np.median takes five times as long
    middle = columns.shape[1] // 2
    return np.partition(columns, middle, axis=1)[:, middle]


def world_frame_problem(centres: Array, poses: Array) -> tuple[Problem, ...]:
    """Return a Problem if the scans move in their own coordinates while the odometry finds no motion.

    Args:
        centres: (N, 2) `centre` of the scans as recorded [m]; NaN for an empty scan.
        poses: (N, 4, 4) T_world_lidar by the odometry.
    """
    known = np.isfinite(centres).all(axis=1)
    moved = np.linalg.norm(centres[known] - centres[known][:1], axis=1)
    if len(moved) < 2 or moved.max() < FARTHEST:
        return ()
    found = float(np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1).max())
    steps = np.linalg.norm(np.diff(centres[known], axis=0), axis=1)
    if found > STANDING * moved.max() or steps.max() > JUMP * moved.max():
        return ()
    fault = f"the LiDAR does not move, but the centre of the scans moves {moved.max():.0f} m"
    text = f"{fault}: the points seem to be in the world frame; save each scan in the sensor's frame, as recorded"
    return (Problem("world frame", text),)
