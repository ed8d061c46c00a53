"""Body frame of a trajectory (LiDAR or camera 0), and the transform from one to the other."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError

#: "lidar": x forward, y left, z up. "camera": KITTI's camera 0, x right, y down, z forward.
BodyFrame = Literal["lidar", "camera", "unknown"]

#: The frame is unknown if the trajectory stays within this distance from its start [m], since the motion may be noise,
#: or if no axis has at least this share of the squared motion.
MIN_DISTANCE = 2.0
MIN_SHARE = 0.8
ROUNDING = 1e-2  # tolerance of R^T R for rotations rounded in text files


def body_frame(poses: Array) -> BodyFrame:
    """Infer the body frame of a vehicle's poses from the axis of its motion: a vehicle drives forward.

    Args:
        poses: (N, 4, 4) [m], N >= 1.

    Returns:
        "lidar" if most of the motion between consecutive poses is along the body's x, "camera" if it is along z,
        "unknown" if no axis dominates or the body hardly moved.

    Example:
        >>> ahead = np.tile(np.eye(4), (5, 1, 1)); ahead[:, 0, 3] = range(5)
        >>> body_frame(ahead), body_frame(ahead[:2])
        ('lidar', 'unknown')
    """
    position = poses[:, :3, 3]
    if np.linalg.norm(position - position[0], axis=1).max() < MIN_DISTANCE:
        return "unknown"
    motion = (se3.inverse(poses[:-1]) @ poses[1:])[:, :3, 3]
    share = (motion**2).sum(axis=0) / (motion**2).sum()
    if share[0] > MIN_SHARE:
        return "lidar"
    return "camera" if share[2] > MIN_SHARE else "unknown"


def into_lidar_frame(poses: Array, T_camera0_lidar: Array) -> Array:
    """Convert poses P of KITTI's camera 0 into poses of the LiDAR: inv(Tr) P Tr.

    Args:
        poses: Poses of camera 0 (N, 4, 4) [m], in the frame of the first.
        T_camera0_lidar: Tr (4, 4), maps points from the LiDAR frame into camera 0.

    Returns:
        Poses of the LiDAR (N, 4, 4) [m], in the frame of the first.
    """
    return se3.inverse(T_camera0_lidar) @ poses @ T_camera0_lidar


def read_camera0_calibration(path: Path) -> Array:
    """Read the LiDAR-to-camera-0 transform from KITTI odometry's calib.txt or KITTI raw's calib_velo_to_cam.txt.

    Camera 0 of the raw file is unrectified; that of the odometry file is rectified (they differ by under a degree).

    Args:
        path: A file with the line `Tr:`, or the lines `R:` and `T:`.

    Returns:
        T_camera0_lidar (4, 4) [m], maps points from the LiDAR frame into camera 0.

    Raises:
        InputError: The file is missing, has neither, or is of another pair of sensors.
    """
    from slam.data.files import matrix, read_keyed_numbers  # imports numba, which nothing else here needs

    entries = read_keyed_numbers(path)
    if "Tr" in entries:
        T = matrix(entries, path, "Tr")
    elif "R" in entries and "T" in entries:
        T = matrix(entries, path, "R", "T")
    else:
        raise InputError(
            f"{path}: no LiDAR-to-camera transform found; expected the line 'Tr:' of a KITTI odometry calib.txt "
            "or 'R:' and 'T:' of a KITTI raw calib_velo_to_cam.txt"
        )
    if not is_rotation(T):
        raise InputError(f"{path}: the LiDAR-to-camera transform is not a rigid motion; check the file")
    if T[2, 0] < 0.5:
        raise InputError(
            f"{path}: does not map the LiDAR's forward axis (x) to the camera's (z); "
            "is it of another pair of sensors, such as calib_imu_to_velo.txt?"
        )
    return T


def is_rotation(poses: Array) -> bool:
    """Check whether the 3x3 part of a pose (4, 4), or of all poses (N, 4, 4), is a rotation, up to rounding."""
    R = poses[..., :3, :3]
    orthonormal = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max() < ROUNDING
    return bool(orthonormal and (np.linalg.det(R) > 0).all())


def require_same_frame(
    estimate: Array, reference: Array, names: tuple[str, str], calibrated_from: BodyFrame | None = None
) -> None:
    """Check that two trajectories have the same body frame; otherwise the metrics are meaningless.

    Args:
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (M, 4, 4) [m].
        names: Names of the two files, for the message.
        calibrated_from: Body frame of the reference before --calib transformed it into the LiDAR frame, None without
            --calib.

    Raises:
        InputError: The body frames are known and differ, or --calib was given for a reference in the LiDAR frame.
    """
    if calibrated_from == "lidar":
        raise InputError(
            f"{names[1]}: moves forward along x, so it is in the LiDAR frame already; "
            "--calib is for references in camera-0 axes (forward along z): leave it out"
        )
    kinds = body_frame(estimate), body_frame(reference)
    if "unknown" in kinds or kinds[0] == kinds[1]:
        return
    if calibrated_from is not None:
        raise InputError(
            f"{names[0]}: moves forward along z, so it is in camera-0 axes, while --calib transforms the reference "
            "into the LiDAR frame; if both are in camera-0 axes leave --calib out"
        )
    if kinds[1] == "camera":
        raise InputError(
            f"{names[0]} is a LiDAR trajectory (moves forward along x), {names[1]} one of camera 0 (along z): errors "
            "between different body frames are meaningless; give the calibration with --calib calib.txt"
        )
    raise InputError(
        f"{names[0]} is in camera-0 axes (moves forward along z), {names[1]} in LiDAR axes (along x): errors between "
        "different body frames are meaningless; export the estimate in the LiDAR frame, or give a reference in "
        "camera-0 axes"
    )
