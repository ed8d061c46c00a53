"""Whether w comes first, told by the motion or by the odometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array
from slam.data.conventions import ORDERS
from slam.data.quaternion_order import as_rotations, order_by_motion, orders_by_odometry


def drive(seed: int, count: int = 200) -> Array:
    """Two metres a pose in bends, from anywhere, uphill and down."""
    rng = np.random.default_rng(seed)
    bend, phase = rng.uniform(0.01, 0.05), rng.uniform(0, 2 * np.pi)
    pose, poses = se3.exp(np.append(rng.uniform(-1, 1, 3), rng.uniform(-1e3, 1e3, 3))), []
    for k in range(count):
        poses.append(pose)
        pose = pose @ se3.exp(np.array([0, 0.002 * np.cos(k / 9), bend * np.sin(k / 15 + phase), 2, 0, 0]))
    return np.array(poses)


def readings(poses: Array, order: str) -> dict[str, Array]:
    """The poses (N, 4, 4) written in one order and read in either."""
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=order == "wxyz")
    found = {}
    for way in ORDERS:
        found[way] = poses.copy()
        found[way][:, :3, :3] = as_rotations(quaternions, way)
    return found


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from(ORDERS))
def test_a_drive_in_bends_tells_its_order_or_nothing(seed: int, order: str) -> None:
    assert order_by_motion(readings(drive(seed), order)) in (order, None)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from(ORDERS))
def test_the_odometry_tells_the_order(seed: int, order: str) -> None:
    poses = drive(seed, 60)
    noise = np.random.default_rng(seed).normal(0, [1e-3] * 3 + [0.02] * 3, (60, 6))
    seen = se3.inverse(poses[0]) @ poses @ np.array([se3.exp(xi) for xi in noise])
    found = readings(poses, order)
    assert order in orders_by_odometry(found, seen)


def test_most_drives_tell() -> None:
    told = [order_by_motion(readings(drive(seed), order)) == order for seed in range(20) for order in ORDERS]
    assert np.mean(told) > 0.8


@pytest.mark.parametrize("order", ORDERS)
def test_a_few_poses_are_never_read_otherwise_than_tum_says(order: str) -> None:
    assert order_by_motion(readings(drive(1)[::40], order)) in ("xyzw", None)


def test_a_car_that_reverses_is_not_one_that_drives_ahead() -> None:
    back = np.tile(np.eye(4), (50, 1, 1))
    back[:, 0, 3] = -np.arange(50)
    assert order_by_motion(readings(back, "xyzw")) is None


def test_where_the_odometry_agrees_with_neither_nothing_is_told() -> None:
    assert orders_by_odometry(readings(drive(2, 60), "xyzw"), drive(3, 60)) == ()


def test_truth_that_is_known_here_and_there_is_enough() -> None:
    poses = drive(4, 60)
    found = readings(poses, "wxyz")
    for read in found.values():
        read[20:40] = np.nan
    assert orders_by_odometry(found, poses) == ("wxyz",)


def test_both_agree_where_they_mean_the_same() -> None:
    ahead = np.tile(np.eye(4), (60, 1, 1))
    ahead[:, 0, 3] = np.arange(60)
    assert orders_by_odometry(readings(ahead, "wxyz"), ahead) == ORDERS
