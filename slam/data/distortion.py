"""Correction of distorted scans: deskewing, and the elevation error of the HDL-64E."""

from __future__ import annotations

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.kernels import move_to_stamp, raise_elevation


def deskew(cloud: PointCloud, velocity: Array) -> PointCloud:
    """Deskew a cloud: move each point to its position in the sensor's frame at the scan's stamp.

    The velocity is taken as constant over the sweep, as in KISS-ICP (Vizzo et al., RA-L 2023, eq. 2). A cloud without
    point times is returned unchanged.

    Args:
        cloud: The cloud as recorded.
        velocity: (6,), rotation [rad/s] first, then translation [m/s], in the sensor's frame.
    """
    if cloud.time is None:
        return cloud
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = se3.skew(velocity[:3]), velocity[3:]
    return cloud.with_xyz(move_to_stamp(cloud.xyz, cloud.time, X[:3], (X @ X / 2)[:3], (X @ X @ X / 6)[:3]))


def correct_vertical(cloud: PointCloud, angle: float) -> PointCloud:
    """Raise the elevation of every point by `angle` [rad]; KITTI's HDL-64E needs 0.205 deg.

    Each point p is rotated about p x z (Deschaud, "IMLS-SLAM", ICRA 2018). Recover and drop rings before: afterwards
    the points no longer lie on the laser lines.
    """
    if angle == 0.0:
        return cloud
    return cloud.with_xyz(raise_elevation(cloud.xyz, np.sin(angle), np.cos(angle)))
