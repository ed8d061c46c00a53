import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slam.simulation.terrain import Terrain, noise


def hill(count: int = 60) -> np.ndarray:
    """A road along x that climbs 6 m and turns."""
    x = np.linspace(0, 150, count)
    return np.column_stack([x, 20 * np.sin(x / 60), 6 * np.sin(x / 100)])


def test_the_ground_passes_through_the_heights_of_the_drive() -> None:
    points = hill()
    terrain = Terrain(points, np.random.default_rng(0), hills=0.0)
    np.testing.assert_allclose(terrain.height(points[:, 0], points[:, 1]), points[:, 2], atol=0.2)


def test_two_heights_of_one_place_are_averaged() -> None:
    flat = np.column_stack([np.linspace(0, 100, 50), np.zeros(50), np.zeros(50)])
    terrain = Terrain(np.concatenate([flat, flat + np.array([0, 0, 1.0])]), np.random.default_rng(0), hills=0.0)
    np.testing.assert_allclose(terrain.height(flat[:, 0], flat[:, 1]), 0.5, atol=0.02)


def test_without_hills_level_ground_stays_level() -> None:
    flat = np.column_stack([np.linspace(0, 100, 50), np.zeros(50), np.full(50, 3.0)])
    terrain = Terrain(flat, np.random.default_rng(0), hills=0.0)
    x, y = np.meshgrid(np.linspace(-100, 200, 20), np.linspace(-100, 100, 20))
    np.testing.assert_allclose(terrain.height(x, y), 3.0, atol=1e-3)


def test_a_car_leans_with_the_ground() -> None:
    x = np.linspace(0, 100, 50)
    slope = Terrain(np.column_stack([x, np.zeros(50), 0.1 * x]), np.random.default_rng(0), hills=0.0)
    yaw = np.array([0.0, np.pi / 2, np.pi])
    poses = slope.poses(np.tile([50.0, 0.0], (3, 1)), yaw, 1.5, np.zeros((3, 3)))
    climb = np.arctan(0.1)
    np.testing.assert_allclose(poses[:, :3, 0][:, 2], np.sin([climb, 0, -climb]), atol=2e-3)
    np.testing.assert_allclose(poses[:, :3, 3], [[50 - 1.5 * np.sin(climb), 0, 5 + 1.5 * np.cos(climb)]] * 3, atol=0.03)
    rotation = poses[:, :3, :3]
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0)
    np.testing.assert_allclose(rotation @ np.swapaxes(rotation, 1, 2), np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)


def test_the_car_sways_as_told() -> None:
    flat = Terrain(np.column_stack([np.linspace(0, 99, 50), np.zeros((50, 2))]), np.random.default_rng(0), hills=0.0)
    (pose,) = flat.poses(np.array([[50.0, 0.0]]), np.zeros(1), 1.0, np.array([[0.02, 0.03, 0.1]]))
    np.testing.assert_allclose([pose[2, 1], -pose[2, 0]], np.sin([0.02, 0.03]), atol=1e-4)  # roll: left side up
    assert abs(pose[2, 3] - 1.1) < 1e-3


@given(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6), st.integers(0, 2**31))
def test_noise_is_bounded_continuous_and_repeatable(i: int, j: int, seed: int) -> None:
    x, y = np.array([i, i + 0.3, i + 0.3 + 1e-6]), np.array([j, j + 0.7, j + 0.7])
    values = noise(x, y, seed)
    assert (np.abs(values) <= 1).all()
    assert abs(values[2] - values[1]) < 1e-4
    np.testing.assert_array_equal(values, noise(x, y, seed))
