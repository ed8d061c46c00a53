"""Whose poses a trajectory holds, the LiDAR's or a camera's, and the way from one to the other."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array

#: "lidar": x forward, y left, z up. "camera": x right, y down, z forward.
BodyFrame = Literal["lidar", "camera", "unknown"]

#: Below this distance from the start [m] the motion may be noise, and below this share of the squared motion an axis
#: does not stand out: then the frame is unknown.
MIN_DISTANCE = 2.0
MIN_SHARE = 0.8
MIN_TURN = 0.5  # rad in all: less may be noise
ROUNDING = 1e-2  # of R^T R, as text files keep rotations


def body_frame(poses: Array) -> BodyFrame:
    """The frame of a vehicle's poses, told from the axis along which the body moves: a vehicle drives forward.

    Args:
        poses: (N, 4, 4) [m].

    Returns:
        "lidar" if most of the motion between consecutive poses is along the body's x, "camera" if it is along z and
        does not turn about it, "unknown" if neither stands out or the body hardly moved. A LiDAR in a lift or below a
        drone moves along z too, but turns about it.

    Example:
        >>> ahead = np.tile(np.eye(4), (5, 1, 1)); ahead[:, 0, 3] = range(5)
        >>> body_frame(ahead), body_frame(ahead[:2])
        ('lidar', 'unknown')
    """
    position = poses[:, :3, 3]
    if np.linalg.norm(position - position[:1], axis=1).max(initial=0) < MIN_DISTANCE:
        return "unknown"
    motion = se3.inverse(poses[:-1]) @ poses[1:]
    way = (motion[:, :3, 3] ** 2).sum(axis=0)
    share = way / way.sum()
    if share[0] > MIN_SHARE:
        return "lidar"
    return "camera" if share[2] > MIN_SHARE and not _turns_about_z(motion) else "unknown"


def into_lidar_frame(poses: Array, T_camera_lidar: Array) -> Array:
    """Poses P of a camera as poses of the LiDAR: inv(T) P T, as of KITTI's camera 0 with T = Tr.

    Args:
        poses: Of the camera (N, 4, 4) [m], in the axes of the first.
        T_camera_lidar: (4, 4), maps points of the LiDAR into the camera.

    Returns:
        Poses of the LiDAR (N, 4, 4) [m], in the axes of the first.
    """
    return se3.inverse(T_camera_lidar) @ poses @ T_camera_lidar


def rotations(poses: Array) -> Array:
    """Which poses (N, 4, 4) are finite and have a rotation, up to a text file's rounding: (N,) bool."""
    finite = np.isfinite(poses).all(axis=(1, 2), keepdims=True)
    R = np.where(finite, poses[:, :3, :3], 0)
    orthonormal = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(1, 2), initial=0) < ROUNDING
    return np.asarray(orthonormal & (np.linalg.det(R) > 0))


def _turns_about_z(motion: Array) -> bool:
    turns = np.abs(Rotation.from_matrix(motion[:, :3, :3]).as_rotvec()).sum(axis=0)
    return bool(turns.max() > MIN_TURN and turns.argmax() == 2)
