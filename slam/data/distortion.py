"""Correction of distorted scans: deskewing, and the elevation error of the HDL-64E."""

from __future__ import annotations

from dataclasses import dataclass, field

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
    return cloud.with_xyz(_moved_to_stamp(cloud.xyz, cloud.time, velocity))


def correct_vertical(cloud: PointCloud, angle: float) -> PointCloud:
    """Raise the elevation of every point by `angle` [rad]; KITTI's HDL-64E needs 0.205 deg.

    Each point p is rotated about p x z (Deschaud, "IMLS-SLAM", ICRA 2018). Recover and drop rings before: afterwards
    the points no longer lie on the laser lines.
    """
    if angle == 0.0:
        return cloud
    return cloud.with_xyz(raise_elevation(cloud.xyz, np.sin(angle), np.cos(angle)))


@dataclass(frozen=True, eq=False)
class Correction:
    """Correction of a scan's points: deskewing, then the elevation, then a change of the frame.

    A scan is downsampled before it is corrected, and corrected as a whole only where all of its points are needed.

    Attributes:
        velocity: (6,), as in `deskew`.
        angle: As in `correct_vertical` [rad].
        T: Pose (4, 4) of the corrected points in the new frame.
    """

    velocity: Array = field(default_factory=lambda: np.zeros(6))
    angle: float = 0.0
    T: Array | None = None

    def points(self, xyz: Array, time: Array | None) -> Array:
        """Return points (N, 3) with times (N,) [s], or without times, corrected in the sensor's own frame."""
        if time is not None:
            xyz = _moved_to_stamp(xyz, time, self.velocity)
        return xyz if self.angle == 0.0 else raise_elevation(xyz, np.sin(self.angle), np.cos(self.angle))

    def cloud(self, cloud: PointCloud) -> PointCloud:
        """Return a cloud as recorded, corrected and in the new frame."""
        corrected = cloud.with_xyz(self.points(cloud.xyz, cloud.time))
        return corrected if self.T is None else corrected.transformed(self.T)


def _moved_to_stamp(xyz: Array, time: Array, velocity: Array) -> Array:
    """Points (N, 3) with times (N,) at the stamp."""
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = se3.skew(velocity[:3]), velocity[3:]
    return move_to_stamp(xyz, time, X[:3], (X @ X / 2)[:3], (X @ X @ X / 6)[:3])
