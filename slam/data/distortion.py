"""What bends a scan, undone: the motion of the sensor during the sweep, and the HDL-64E's elevation error."""

from __future__ import annotations

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.kernels import move_to_stamp, raise_elevation


def deskew(cloud: PointCloud, velocity: Array) -> PointCloud:
    """The cloud as a sensor standing still at the instant of the scan's stamp would have seen it.

    `velocity` (6,), rotation [rad/s] first, then translation [m/s], in the sensor's axes, is taken as constant over the
    sweep, as in KISS-ICP (Vizzo et al., RA-L 2023, eq. 2). Clouds without times are returned as they are.
    """
    if cloud.time is None:
        return cloud
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = se3.skew(velocity[:3]), velocity[3:]
    return cloud.with_xyz(move_to_stamp(cloud.xyz, cloud.time, X[:3], (X @ X / 2)[:3], (X @ X @ X / 6)[:3]))


def correct_vertical(cloud: PointCloud, angle: float) -> PointCloud:
    """The cloud with every elevation raised by `angle` [rad]: KITTI's HDL-64E needs 0.205 deg.

    A rotation of each point p about p x z (Deschaud, "IMLS-SLAM", ICRA 2018). Rings must have been recovered and
    dropped before: afterwards the points no longer lie on their lasers' lines.
    """
    if angle == 0.0:
        return cloud
    return cloud.with_xyz(raise_elevation(cloud.xyz, np.sin(angle), np.cos(angle)))
