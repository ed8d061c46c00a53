"""Downsampling of clouds, and the Gaussians of a map's cells."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.data import se3
from slam.data.cloud import Array
from slam.registration.voxels import VoxelFilter, VoxelGaussians


def ones(xyz: Array) -> Array:
    return np.ones(len(xyz), np.float32)


def at(x: float, y: float = 0.0, z: float = 0.0) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def gaussian(cells: VoxelGaussians, probe: Array) -> tuple[Array, Array] | None:
    """Mean and covariance (with its regularisation) of the cell in which `probe` (3,) lies; None if it has no Gaussian.

    A single point with the identity's rotation gives H[3:, 3:] = S^-1 and gradient[3:] = S^-1 (x - mean).
    """
    origin = np.zeros((1, 3), np.float32)
    H, gradient, totals = cells.normal_equations(origin, ones(origin), at(*probe), 1, 1e9)
    if totals[4] == 0:
        return None
    covariance = np.linalg.inv(H[3:, 3:])
    return probe - covariance @ gradient[3:], covariance


# ---- the filter


def test_centroids_of_a_literal_cloud() -> None:
    xyz = np.array([[5.1, 0.1, 0.1], [1.2, 0.2, 0.2], [5.3, 0.5, 0.3], [1.4, 0.6, 0.4], [-0.1, 1.1, 0.5]], np.float32)
    centroids, weights, times = VoxelFilter(1.0)(xyz, ones(xyz), np.array([0, 1, 2, 3, 4], np.float32))
    np.testing.assert_allclose(centroids, [[5.2, 0.3, 0.2], [1.3, 0.4, 0.3], [-0.1, 1.1, 0.5]], atol=1e-6)
    assert weights.tolist() == [1, 1, 1]
    assert times.tolist() == [1, 2, 4]  # in the order of the cells' first points
    assert centroids.dtype == weights.dtype == np.float32


def test_centroids_follow_the_weights() -> None:
    xyz = np.array([[1.0, 1.0, 1.0], [1.4, 1.8, 1.0], [7.5, 0.5, 0.5]], np.float32)
    centroids, weights, _ = VoxelFilter(1.0)(xyz, np.array([3, 1, 0.25], np.float32))
    np.testing.assert_allclose(centroids, [[1.1, 1.2, 1.0], [7.5, 0.5, 0.5]], atol=1e-6)
    np.testing.assert_allclose(weights, [2, 0.25], rtol=1e-6)


def test_cells_on_both_sides_of_the_origin_differ() -> None:
    xyz = np.array([[0.1, 0.1, 0.1], [-0.1, 0.1, 0.1], [0.1, -0.1, 0.1], [0.1, 0.1, -0.1]], np.float32)
    assert len(VoxelFilter(1.0)(xyz, ones(xyz))[0]) == 4


def test_points_outside_the_range_limits_and_nan_are_removed() -> None:
    xyz = np.array([[1, 0, 0], [3, 0, 0], [0, 0, 0], [9, 9, 0], [np.nan, 5, 5], [5, np.inf, 5], [0, 4, 0]], np.float32)
    centroids, weights, times = VoxelFilter(0.5, 2.0, 10.0)(xyz, ones(xyz), np.arange(7, dtype=np.float32))
    assert times.tolist() == [1, 6]
    assert weights.tolist() == [1, 1]
    np.testing.assert_array_equal(centroids, xyz[[1, 6]])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_points_that_are_not_finite_are_removed_without_a_range_limit(bad: float) -> None:
    xyz = np.array([[1, 1, 1], [bad, 1, 1], [1, 1, bad]], np.float32)
    assert VoxelFilter(0.5)(xyz, ones(xyz))[0].tolist() == [[1, 1, 1]]


def test_an_empty_cloud_remains_empty() -> None:
    centroids, weights, times = VoxelFilter(0.5)(np.zeros((0, 3), np.float32), np.zeros(0, np.float32))
    assert centroids.shape == (0, 3)
    assert len(weights) == len(times) == 0


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31), st.integers(1, 3000), st.sampled_from([0.3, 0.5, 1.7]))
def test_filter_agrees_with_numpy(seed: int, count: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-6, 6, (count, 3)).astype(np.float32)
    weight = rng.uniform(0.1, 1, count).astype(np.float32)
    thin = VoxelFilter(size)
    thin(xyz[::-1].copy(), weight)  # the scratch memory of the last scan does not matter
    centroids, weights, times = thin(xyz, weight, xyz[:, 0].copy())

    cells = np.floor(xyz.astype(float) / size).astype(int)
    _, first, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    total = np.bincount(cell.ravel(), weight)
    mean = np.column_stack([np.bincount(cell.ravel(), weight * xyz[:, k]) / total for k in range(3)])
    np.testing.assert_allclose(times, mean[order, 0], atol=1e-5)
    np.testing.assert_allclose(centroids, mean[order], atol=1e-5)
    np.testing.assert_allclose(weights, (total / np.bincount(cell.ravel()))[order], rtol=1e-5)


# ---- the Gaussians


@pytest.mark.parametrize("offset", [0.0, 10_000.0, -10_000.0])
def test_mean_and_covariance_agree_with_numpy(offset: float) -> None:
    rng = np.random.default_rng(3)
    local = rng.normal(5, [0.8, 0.3, 0.05], (300, 3)) @ se3.exp(np.array([0.3, 0.2, 0.4, 0, 0, 0]))[:3, :3].T + 0.0
    local = np.clip(local - local.mean(axis=0) + 5, 0.5, 9.5).astype(np.float32)
    cells = VoxelGaussians(10.0, 3, 10_000, regularisation=0.0)
    for part in np.array_split(local, 7):  # scan by scan
        cells.insert(part, ones(part), at(offset, -offset, 0.0))
    assert len(cells) == 1
    found = gaussian(cells, np.array([offset + 5, -offset + 5, 5.0]))
    assert found is not None
    mean, covariance = found
    exact = local.astype(float)
    np.testing.assert_allclose(mean - [offset, -offset, 0], exact.mean(axis=0), atol=1e-8)
    np.testing.assert_allclose(covariance, np.cov(exact.T) + 1e-6 * np.eye(3), rtol=1e-6, atol=1e-9)


def test_mean_and_covariance_are_weighted() -> None:
    rng = np.random.default_rng(4)
    xyz = rng.uniform(1, 3, (50, 3)).astype(np.float32)
    weight = rng.uniform(0.1, 1, 50).astype(np.float32)
    cells = VoxelGaussians(4.0, 3, 1000, regularisation=0.0)
    cells.insert(xyz, weight, np.eye(4))
    found = gaussian(cells, np.array([2.0, 2, 2]))
    assert found is not None
    np.testing.assert_allclose(found[0], np.average(xyz, axis=0, weights=weight), atol=1e-6)
    doubled = VoxelGaussians(4.0, 3, 1000, regularisation=0.0)
    doubled.insert(xyz, 2 * weight, np.eye(4))  # only the ratio of the weights matters
    again = gaussian(doubled, np.array([2.0, 2, 2]))
    assert again is not None
    np.testing.assert_allclose(again[1], found[1], rtol=1e-6)


def test_points_are_transformed_by_the_pose() -> None:
    xyz = np.random.default_rng(5).uniform(-0.5, 0.5, (40, 3)).astype(np.float32)
    pose = se3.exp(np.array([0.4, -0.2, 1.1, 3, 2, 1.0]))
    cells = VoxelGaussians(20.0, 3, 1000, regularisation=0.0)
    cells.insert(xyz, ones(xyz), pose)
    moved = xyz @ pose[:3, :3].T + pose[:3, 3]
    found = gaussian(cells, moved.mean(axis=0))
    assert found is not None
    np.testing.assert_allclose(found[0], moved.mean(axis=0), atol=1e-6)


def test_a_flat_cell_stays_invertible() -> None:
    xyz = np.random.default_rng(6).uniform(0.1, 0.9, (100, 3)).astype(np.float32)
    xyz[:, 2] = 0.5
    cells = VoxelGaussians(1.0, 5, 1000, regularisation=0.003)
    cells.insert(xyz, ones(xyz), np.eye(4))
    found = gaussian(cells, np.array([0.5, 0.5, 0.5]))
    assert found is not None
    spread = np.linalg.eigvalsh(found[1])
    assert 0 < spread[0] < 0.01 * spread[2]


def test_no_gaussian_below_min_points() -> None:
    xyz = np.random.default_rng(7).uniform(0.1, 0.9, (4, 3)).astype(np.float32)
    cells = VoxelGaussians(1.0, 5, 1000, regularisation=0.003)
    cells.insert(xyz, ones(xyz), np.eye(4))
    assert len(cells) == 1
    assert gaussian(cells, np.array([0.5, 0.5, 0.5])) is None
    cells.insert(xyz[:1] + np.float32(0.05), ones(xyz[:1]), np.eye(4))
    assert gaussian(cells, np.array([0.5, 0.5, 0.5])) is not None


def test_a_cell_with_max_points_is_not_updated() -> None:
    rng = np.random.default_rng(8)
    first, later = rng.uniform(0.1, 0.4, (20, 3)).astype(np.float32), rng.uniform(0.6, 0.9, (20, 3)).astype(np.float32)
    cells = VoxelGaussians(1.0, 5, 20, regularisation=0.0)
    cells.insert(first, ones(first), np.eye(4))
    cells.insert(later, ones(later), np.eye(4))
    found = gaussian(cells, np.array([0.5, 0.5, 0.5]))
    assert found is not None
    np.testing.assert_allclose(found[0], first.mean(axis=0), atol=1e-6)
    cells.insert(later + np.float32(1), ones(later), np.eye(4))  # other cells are still updated
    assert gaussian(cells, np.array([1.5, 1.5, 1.5])) is not None


def test_cells_are_kept_when_the_table_grows() -> None:
    """Far more cells than the initial capacity; all are found afterwards."""
    rng = np.random.default_rng(9)
    cells = VoxelGaussians(1.0, 3, 1000, regularisation=0.0)
    corners = np.stack(np.meshgrid(*[np.arange(-15, 15)] * 3), axis=-1).reshape(-1, 3)
    within = rng.uniform(0.2, 0.8, (4, 3))
    for part in np.array_split(corners, 9):
        xyz = (part[:, None] + within).reshape(-1, 3).astype(np.float32)
        cells.insert(xyz, ones(xyz), np.eye(4))
    assert len(cells) == len(corners) == 27_000
    centres = (corners + within.mean(axis=0)).astype(np.float32)
    *_, totals = cells.normal_equations(centres, ones(centres), np.eye(4), 1, 1.0)
    assert totals[4] == totals[2] == len(corners)


def test_clear_removes_all_cells() -> None:
    xyz = np.random.default_rng(10).uniform(0.1, 0.9, (30, 3)).astype(np.float32)
    cells = VoxelGaussians(1.0, 5, 1000, regularisation=0.003)
    cells.insert(xyz, ones(xyz), np.eye(4))
    cells.clear()
    assert len(cells) == 0
    assert gaussian(cells, np.array([0.5, 0.5, 0.5])) is None


def test_evict_bounds_the_number_of_cells() -> None:
    rng = np.random.default_rng(11)
    cells, sizes = VoxelGaussians(1.0, 3, 1000, regularisation=0.003), []
    xyz = rng.uniform([-5, -5, -1], [5, 5, 1], (2000, 3)).astype(np.float32)
    for k in range(60):
        cells.insert(xyz, ones(xyz), at(5.0 * k))
        cells.evict(np.array([5.0 * k, 0, 0]), 12.0)
        sizes.append(len(cells))
    assert max(sizes[5:]) <= 1.05 * min(sizes[5:])  # constant: the cells within the radius
    assert gaussian(cells, np.array([0.5, 0.5, 0.5])) is None


def test_evict_keeps_the_cells_within_the_radius() -> None:
    rng = np.random.default_rng(12)
    near, far = rng.uniform(0.1, 0.9, (30, 3)), rng.uniform([30.1, 0.1, 0.1], [30.9, 0.9, 0.9], (30, 3))
    xyz = np.concatenate([far, near]).astype(np.float32)
    cells = VoxelGaussians(1.0, 5, 1000, regularisation=0.003)
    cells.insert(xyz, ones(xyz), np.eye(4))
    before = gaussian(cells, np.array([0.5, 0.5, 0.5]))
    cells.evict(np.zeros(3), 10.0)
    after = gaussian(cells, np.array([0.5, 0.5, 0.5]))
    assert before is not None
    assert after is not None
    np.testing.assert_allclose(after[1], before[1], rtol=1e-9)
    assert len(cells) == 1
    assert gaussian(cells, np.array([30.5, 0.5, 0.5])) is None
