"""A user's camera calibration, calib.yaml."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError
from slam.data.yaml_files import numbers, read_mapping

#: What others call the model of k1 k2 p1 p2 [k3 ...], and those that have four coefficients of another meaning.
PINHOLE = ("pinhole", "radtan", "plumb_bob", "brown", "opencv", "rational_polynomial")
FISHEYE = ("fisheye", "equidistant", "kannala_brandt", "opencv_fisheye")
LEAST_TANGENTIAL = 0.02  # lenses that are off centre have p1 and p2 of some thousandths; a fisheye's k3, k4 are larger


def read_calibration(path: Path) -> Calibration:
    """`K` (3x3, pixels), `T_camera_lidar` (4x4, LiDAR points into the camera's frame) and, for images that are not
    rectified, `distortion` (OpenCV's 4, 5, 8, 12 or 14 coefficients) and the `model` that these are of (PINHOLE).

    Raises InputError where one is missing, of another shape, or no camera or rigid motion; where the model is another;
    and where four coefficients may be a fisheye's and no model says otherwise.
    """
    content = read_mapping(path, ("K", "T_camera_lidar", "distortion", "model"))
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
    _check_model(path, content.get("model"), distortion)
    return Calibration(K, T, tuple(distortion.tolist()))


def _check_model(path: Path, model: object, distortion: Array) -> None:
    """Raise InputError where the coefficients are not a pinhole camera's, or may not be."""
    name = None if model is None else str(model).lower().replace("-", "_").replace(" ", "_")
    remedy = "rectify the images (cv2.fisheye.initUndistortRectifyMap) and give the new K without distortion"
    if name in FISHEYE:
        raise InputError(f"{path}: model '{model}': fisheye lenses are not supported; {remedy}")
    if name is not None and name not in PINHOLE:
        raise InputError(f"{path}: unknown model '{model}'; known: {', '.join(PINHOLE)}")
    if name is None and len(distortion) == 4 and np.abs(distortion[2:]).max() > LEAST_TANGENTIAL:
        fault = f"'distortion' may be k1 k2 k3 k4 of a fisheye lens, for {distortion[2]:g} {distortion[3]:g} is much"
        raise InputError(f"{path}: {fault} for p1 p2; say model: pinhole, or for a fisheye {remedy}")
