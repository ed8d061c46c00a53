"""Scans that somebody has already put into the world's frame."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.data.problem import Problem

EVERY = 16  # points: the centre of so many of them is that of all
FARTHEST = 30.0  # m that the centre of what a standing LiDAR sees may wander, as traffic passes
STANDING = 0.1  # of the centre's way, which the odometry finds at most where the motion is in the points
JUMP = 0.25  # of the centre's way in one step: a door that opens, not a drive


def centre(xyz: Array) -> Array:
    """(2,): the middle of points (N, 3), seen from above; NaN for none."""
    return np.median(xyz[::EVERY, :2], axis=0) if len(xyz) else np.full(2, np.nan)


def world_frame_problem(centres: Array, poses: Array) -> tuple[Problem, ...]:
    """A Problem where scans move in their own coordinates, as a car does, while the odometry finds that it stands.

    Args:
        centres: (N, 2) [m], of the scans as recorded; NaN for an empty one.
        poses: (N, 4, 4) T_world_lidar by the odometry.
    """
    known = np.isfinite(centres).all(axis=1)
    way = np.linalg.norm(centres[known] - centres[known][:1], axis=1)
    if len(way) < 2 or way.max() < FARTHEST:
        return ()
    found = float(np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1).max())
    steps = np.linalg.norm(np.diff(centres[known], axis=0), axis=1)
    if found > STANDING * way.max() or steps.max() > JUMP * way.max():
        return ()
    text = (
        f"the LiDAR seems to stand, but the middle of its scans moves {way.max():.0f} m, as if the points were in the"
    )
    return (Problem("world frame", f"{text} world's frame; each scan has to be in the sensor's own, as recorded"),)
