"""A user's camera calibration, calib.yaml."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.cloud import Calibration
from slam.data.errors import InputError
from slam.data.yaml_files import numbers, read_mapping


def read_calibration(path: Path) -> Calibration:
    """`K` (3x3, pixels), `T_camera_lidar` (4x4, LiDAR points into the camera's frame) and, for images that are not
    rectified, `distortion` (OpenCV's 4, 5, 8, 12 or 14 coefficients).

    Raises InputError where one is missing, of another shape, or no camera or rigid motion.
    """
    content = read_mapping(path, ("K", "T_camera_lidar", "distortion"))
    for key in ("K", "T_camera_lidar"):
        if key not in content:
            raise InputError(f"{path}: '{key}' is missing")
    K = numbers(path, "K", content["K"], (3, 3))
    if K[0, 0] <= 0 or K[1, 1] <= 0 or not np.array_equal(K[2], [0, 0, 1]) or K[1, 0] != 0:
        raise InputError(f"{path}: 'K' must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx and fy in pixels")
    T = numbers(path, "T_camera_lidar", content["T_camera_lidar"], (4, 4))
    R = T[:3, :3]
    if not np.allclose(R @ R.T, np.eye(3), atol=1e-3) or np.linalg.det(R) < 0 or not np.allclose(T[3], [0, 0, 0, 1]):
        raise InputError(f"{path}: 'T_camera_lidar' must be a rotation and a translation over the row 0 0 0 1")
    distortion = numbers(path, "distortion", content.get("distortion") or [], (-1,))
    if len(distortion) not in (0, 4, 5, 8, 12, 14):
        raise InputError(f"{path}: {len(distortion)} distortion coefficients; OpenCV's models have 4, 5, 8, 12 or 14")
    return Calibration(K, T, tuple(distortion.tolist()))
