"""A walk with the LiDAR in the hand: smooth, at a person's pace, and known at any time."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.simulation.drives import Drive, built_in, thinned
from slam.simulation.indoors.plan import STOREY
from slam.simulation.indoors.walk import Stop, Walk

FINE = 0.005  # s


@pytest.fixture(scope="module")
def drive() -> Drive:
    return built_in("building")


def path(drive: Drive, stamps: Array) -> Array:
    assert drive.path is not None
    return drive.path(stamps)


def times(drive: Drive) -> Array:
    """From half a sweep before the first frame to half a sweep after the last."""
    return np.arange(-0.05, drive.stamps[-1] + 0.05, FINE)


def test_the_frames_lie_on_the_path_ten_a_second(drive: Drive) -> None:
    poses = path(drive, drive.stamps)
    assert 400 <= len(drive) <= 950
    np.testing.assert_allclose(np.diff(drive.stamps), 0.1)
    np.testing.assert_allclose(poses[:, :2, 3], drive.position[:, :2])
    R = poses[:, :3, :3]
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
    heading = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    np.testing.assert_allclose(np.cos(heading - drive.yaw), 1, atol=1e-9)


def test_it_moves_as_a_person_does(drive: Drive) -> None:
    poses = path(drive, times(drive))
    velocity = np.gradient(poses[:, :3, 3], FINE, axis=0)
    acceleration = np.linalg.norm(np.gradient(velocity, FINE, axis=0), axis=1)
    assert np.linalg.norm(velocity, axis=1).max() < 1.6
    assert acceleration.max() < 4.0
    assert np.abs(np.diff(acceleration)).max() < 1.0, "no jumps in the acceleration either"
    turns = se3.angle(se3.inverse(poses[:-1]) @ poses[1:]) / FINE
    assert 1.9 < turns.max() < 2.2, "the spin on the spot"


def test_it_climbs_to_the_upper_floor_and_comes_back(drive: Drive) -> None:
    floor = drive.position[:, 2]
    assert floor.max() == pytest.approx(STOREY, abs=0.01)
    assert floor[[0, -1]] == pytest.approx(0, abs=0.01)
    assert np.linalg.norm(drive.position[-1] - drive.position[0]) < 1.0
    above = path(drive, drive.stamps)[:, 2, 3] - floor
    assert above.mean() == pytest.approx(1.3, abs=0.02)
    assert 1.2 < above.min() < above.max() < 1.4


def test_the_hand_goes_up_and_down_with_the_steps() -> None:
    walk = Walk((Stop(0, 0, 0), Stop(40, 0, 0)))
    stamps = np.arange(10.0, 30.0, 0.01)
    height = walk(stamps)[:, 2, 3] - walk.floor(stamps)
    spectrum = np.abs(np.fft.rfft(height - height.mean()))
    frequency = np.fft.rfftfreq(len(height), 0.01)
    brisk = frequency > 1.0
    assert frequency[brisk][spectrum[brisk].argmax()] == pytest.approx(1.8, abs=0.06)


def test_one_stands_still_where_the_route_says_and_turns_around_once() -> None:
    walk = Walk((Stop(0, 0, 0), Stop(5, 0, 0, pause=5.0, turns=1), Stop(10, 0, 0)))
    stamps = np.arange(0.0, walk.end, 0.01)
    poses = walk(stamps)
    yaw = walk.yaw(stamps)
    assert yaw[-1] - yaw[0] == pytest.approx(2 * np.pi, abs=0.3)
    fast = np.gradient(yaw, 0.01) > 1.5
    assert np.abs(poses[fast, 0, 3] - 5).max() < 0.15
    assert np.gradient(yaw, 0.01).max() == pytest.approx(2.0, abs=0.15)


def test_before_and_after_the_walk_one_stands(drive: Drive) -> None:
    around = path(drive, np.array([-0.05, 0.0, drive.stamps[-1], drive.stamps[-1] + 0.05]))
    assert np.isfinite(around).all()
    assert np.linalg.norm(around[1, :3, 3] - around[0, :3, 3]) < 0.01
    assert np.linalg.norm(around[3, :3, 3] - around[2, :3, 3]) < 0.01


def test_fewer_frames_have_the_same_path(drive: Drive) -> None:
    other = thinned(drive, 3)
    np.testing.assert_array_equal(path(other, other.stamps), path(drive, drive.stamps)[::3])


def test_a_spacing_is_an_error() -> None:
    with pytest.raises(InputError, match=r"building: --spacing does not apply to a walk.*leave it out"):
        built_in("building", spacing=1.0)
