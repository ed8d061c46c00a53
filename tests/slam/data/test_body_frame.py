"""Which body a trajectory belongs to."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import se3
from slam.data.body_frame import body_frame, into_lidar_frame, rotations
from slam.data.cloud import Array

#: The axes of camera 0 (x right, y down, z forward) in a LiDAR's (x forward, y left, z up), and a lever arm.
T_CAMERA0_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])


def drive(axis: int = 0, count: int = 30) -> Array:
    """A bend of 0.5 m a pose, forward along the body's axis 0 (LiDAR) or 2 (camera)."""
    xi = np.array([0, 0, 0.02, 0.5, 0, 0]) if axis == 0 else np.array([0, -0.02, 0, 0, 0, 0.5])
    return np.array([se3.exp(k * xi) for k in range(count)])


def test_forward_along_x_is_lidar_along_z_camera() -> None:
    assert body_frame(drive(0)) == "lidar"
    assert body_frame(drive(2)) == "camera"


def test_where_the_world_points_does_not_matter() -> None:
    assert body_frame(se3.exp(np.array([1.0, 2, 0.5, 9, 9, 9])) @ drive(2)) == "camera"


@pytest.mark.parametrize(
    "poses",
    [
        np.tile(np.eye(4), (50, 1, 1)),
        drive(0, 1),
        np.array([se3.exp(np.array([0, 0, 0, 0.3, 0, 0.3]) * k) for k in range(30)]),
    ],
    ids=["standing", "one pose", "diagonal"],
)
def test_too_little_to_tell(poses: Array) -> None:
    assert body_frame(poses) == "unknown"


def test_a_noisy_standing_sensor_is_unknown() -> None:
    poses = np.tile(np.eye(4), (100, 1, 1))
    poses[:, 2, 3] = 0.05 * np.random.default_rng(0).normal(size=100)
    assert body_frame(poses) == "unknown"


def test_a_camera_drive_becomes_the_lidars() -> None:
    lidar = drive(0)
    camera = T_CAMERA0_LIDAR @ lidar @ se3.inverse(T_CAMERA0_LIDAR)
    assert body_frame(camera) == "camera"
    np.testing.assert_allclose(into_lidar_frame(camera, T_CAMERA0_LIDAR), lidar, atol=1e-12)


def test_a_lift_that_turns_is_no_camera() -> None:
    rising = np.array([se3.exp(k * np.array([0, 0, 0.05, 0, 0, 0.5])) for k in range(30)])
    assert body_frame(rising) == "unknown"


def test_no_poses_have_no_frame() -> None:
    assert body_frame(np.zeros((0, 4, 4))) == "unknown"


def test_what_is_a_rotation() -> None:
    poses = np.array([np.eye(4), np.diag([1.0, 1, -1, 1]), np.diag([2.0, 2, 2, 1]), np.full((4, 4), np.nan)])
    assert rotations(poses).tolist() == [True, False, False, False]
