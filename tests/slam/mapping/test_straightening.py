"""Keyframes registered anew with what lies well behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.mapping.keyframes import Keyframe
from slam.mapping.straightening import Straightener
from slam.mapping.visibility import RangeImage

STEP = 2.0  # m of way between keyframes
TILT = np.deg2rad(0.1)  # that the odometry adds at each of them


def world() -> Array:
    """Points of a road between walls, with posts."""
    rng = np.random.default_rng(3)
    road = np.column_stack([rng.uniform(-50, 120, 80_000), rng.uniform(-12, 12, 80_000), np.full(80_000, -1.7)])
    walls = np.column_stack(
        [rng.uniform(-50, 120, 40_000), rng.choice([-12.0, 12.0], 40_000), rng.uniform(-2, 5, 40_000)]
    )
    posts = [rng.normal([x, y, 1], [0.1, 0.1, 1], (400, 3)) for x in np.arange(-48, 120, 7.3) for y in (-8, 9)]
    return np.concatenate([road, walls, *posts])


def keyframes(count: int, scene: Array) -> list[Keyframe]:
    """Straight on in truth; by the odometry the way bends upwards."""
    found, pose = [], np.eye(4)
    for number in range(count):
        x = STEP * number
        near = scene[np.abs(scene[:, 0] - x) < 40] - [x, 0, 0]
        cloud = PointCloud(near.astype(np.float32), np.zeros(len(near)))
        found.append(Keyframe(number, pose, x, cloud, RangeImage.of(cloud)))
        pose = pose @ se3.exp(np.array([0, -TILT, 0, STEP, 0, 0]))
    return found


def test_what_the_odometry_bends_is_straight_again() -> None:
    drive = keyframes(30, world())
    straightener = Straightener(held_back=10.0)
    poses = np.array([straightener.pose(keyframe) for keyframe in drive])
    assert drive[-1].pose[2, 3] > 1.0
    np.testing.assert_array_equal(poses[0], drive[0].pose)
    rise = poses[-1][:3, :3] @ [1.0, 0, 0]
    assert rise[2] == pytest.approx(
        poses[5][2, 0], abs=np.deg2rad(0.3)
    )  # the tilt that it began with; 2.4 deg more else


def test_without_anything_behind_it_the_odometry_goes_on() -> None:
    drive = keyframes(5, world())
    straightener = Straightener(held_back=10.0)
    for keyframe in drive:
        np.testing.assert_allclose(straightener.pose(keyframe), keyframe.pose, atol=1e-9)


def test_a_registration_that_leads_far_away_is_not_believed() -> None:
    drive = keyframes(9, world())
    last = drive[-1]
    lifted = PointCloud(last.cloud.xyz + np.array([0, 0, 0.8], np.float32), last.cloud.intensity)
    straightener = Straightener(held_back=10.0)
    before = [straightener.pose(keyframe) for keyframe in drive[:-1]][-1]
    found = straightener.pose(replace(last, cloud=lifted))
    np.testing.assert_allclose(found, before @ se3.inverse(drive[-2].pose) @ last.pose, atol=1e-9)
