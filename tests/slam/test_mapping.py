"""The global map against averages done by hand."""

from __future__ import annotations

import numpy as np
import pytest

from slam.config import MapSettings
from slam.data.cloud import Array, PointCloud
from slam.mapping import GlobalMap


def cloud(*points: tuple[float, float, float], intensity: Array | None = None) -> PointCloud:
    xyz = np.array(points, float).reshape(-1, 3)
    return PointCloud(xyz, np.zeros(len(xyz)) if intensity is None else intensity)


def world(voxel_size: float = 1.0, min_range: float = 0.0, max_range: float = 1e3) -> GlobalMap:
    return GlobalMap(MapSettings(voxel_size=voxel_size, min_range=min_range, max_range=max_range))


def at(x: float, y: float = 0.0, z: float = 0.0) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def test_an_empty_map_has_no_points() -> None:
    assert len(world()) == 0
    assert world().points().xyz.shape == (0, 3)


def test_a_voxel_holds_the_average_of_its_points() -> None:
    grid = world()
    grid.insert(cloud((5.1, 0.2, 0.3), (7.5, 0.5, 0.5), intensity=np.array([0.2, 0.9])), np.eye(4))
    grid.insert(cloud((5.3, 0.4, 0.9), (5.8, 0.9, 0.0), intensity=np.array([0.4, 0.6])), np.eye(4))
    points = grid.points()
    assert len(grid) == len(points) == 2
    assert points.xyz == pytest.approx(np.array([[5.4, 0.5, 0.4], [7.5, 0.5, 0.5]]), abs=1e-5)
    assert points.intensity == pytest.approx(np.array([0.4, 0.9]), abs=1e-6)


def test_negative_coordinates_have_voxels_of_their_own() -> None:
    """-0.1 and 0.1 are neighbours, not the same; -0.1 and -0.9 are the same."""
    grid = world()
    grid.insert(cloud((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1), (-0.9, -0.3, -0.5)), np.eye(4))
    assert grid.points().xyz == pytest.approx(np.array([[-0.5, -0.2, -0.3], [0.1, 0.1, 0.1]]), abs=1e-6)


@pytest.mark.parametrize("far", [(10_000.0, -8_000.0, 300.0), (-10_000.0, 8_000.0, -300.0)])
def test_far_from_the_origin_averages_stay_exact(far: tuple[float, float, float]) -> None:
    grid = world(voxel_size=0.2)
    for _ in range(50):
        grid.insert(cloud((0.05, 0.1, 0.11), (0.15, 0.1, 0.13)), at(*far))
    assert len(grid) == 1
    assert grid.points().xyz[0] == pytest.approx(np.add(far, (0.1, 0.1, 0.12)), abs=1.1e-3)  # half a float32 step


def test_points_are_moved_by_the_whole_pose() -> None:
    grid, pose = world(), at(10, 20, 30)
    pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    grid.insert(cloud((3.3, 1.4, 0.5)), pose)
    assert grid.points().xyz[0] == pytest.approx([8.6, 23.3, 30.5], abs=1e-5)


def test_the_range_is_the_sensors_not_the_worlds() -> None:
    grid = world(min_range=2.5, max_range=60.0)
    grid.insert(cloud((2.4, 0, 0), (2.6, 0, 0), (0, 0, -59), (0, 61, 0), (36, 48.1, 0)), at(500))
    assert sorted(grid.points().xyz[:, 0].tolist()) == pytest.approx([500, 502.6], abs=1e-3)


def test_the_same_scan_again_adds_nothing() -> None:
    """The size follows the area seen, not the number of scans; so does the memory."""
    grid = world(voxel_size=0.2)
    scan = cloud(*np.random.default_rng(0).uniform(-20, 20, (5_000, 3)))
    grid.insert(scan, np.eye(4))
    once, size = grid.points(), len(grid)
    for _ in range(100):
        grid.insert(scan, np.eye(4))
    assert len(grid) == size
    assert grid.points().xyz == pytest.approx(once.xyz, abs=1e-4)
    assert len(grid._sums) == 1 << 16


def test_it_grows_beyond_its_first_capacity() -> None:
    """Against numpy's averages of 150,000 points in many batches."""
    rng, grid = np.random.default_rng(1), world(voxel_size=0.5)
    xyz = rng.uniform(-40, 40, (150_000, 3)).astype(np.float32)
    intensity = rng.random(len(xyz)).astype(np.float32)
    for part in np.array_split(np.arange(len(xyz)), 7):
        grid.insert(PointCloud(xyz[part], intensity[part]), np.eye(4))
    _, voxel = np.unique(np.floor(xyz.astype(float) / 0.5).astype(int), axis=0, return_inverse=True)
    count = np.bincount(voxel)
    assert len(grid) == len(count) > 1 << 16
    points = grid.points()
    ours = np.unique(np.floor(points.xyz.astype(float) / 0.5).astype(int), axis=0, return_index=True)[1]
    assert len(ours) == len(count)
    mean = np.column_stack([np.bincount(voxel, xyz[:, axis]) for axis in range(3)]) / count[:, None]
    assert np.abs(points.xyz[ours] - mean).max() < 1e-4
    assert np.abs(points.intensity[ours] - np.bincount(voxel, intensity) / count).max() < 1e-5


def test_points_given_out_do_not_change_later() -> None:
    grid = world()
    grid.insert(cloud((5.1, 0.2, 0.3)), np.eye(4))
    before = grid.points()
    kept = before.xyz.copy()
    grid.insert(cloud((5.9, 0.2, 0.3)), np.eye(4))
    np.testing.assert_array_equal(before.xyz, kept)
