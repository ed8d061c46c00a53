"""Depth images completed: exact on planes where that is promised, and never outside what was measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enrichment.geometry.rays import RayGrid, range_image
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.depth_completion import (
    delaunay,
    ip_basic,
    markov_random_field,
    markov_random_field_method,
    nearest_method,
    nearest_sample,
)
from enrichment.methods.registry import COMPLETIONS
from slam.data.cloud import Array, Calibration, PointCloud

SHAPE = (60, 80)
GREY = np.full((*SHAPE, 3), 128, np.uint8)
LOOKING_AHEAD = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.1], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[700.0, 0, 600], [0, 700.0, 170], [0, 0, 1]]), LOOKING_AHEAD)


def samples(*at: tuple[int, int, float]) -> Array:
    """(H, W) with depths at rows and columns."""
    sparse = np.zeros(SHAPE, np.float32)
    for v, u, depth in at:
        sparse[v, u] = depth
    return sparse


def test_delaunay_is_exact_on_a_plane_in_inverse_depth() -> None:
    v, u = np.indices(SHAPE)
    plane = 1 / (0.02 + 0.001 * v + 0.0005 * u)
    chosen = np.random.default_rng(0).random(SHAPE) < 0.03
    chosen[[0, 0, -1, -1], [0, -1, 0, -1]] = True  # so that the hull is the image
    dense = delaunay(np.where(chosen, plane, 0).astype(np.float32), GREY)
    np.testing.assert_allclose(dense, plane, rtol=1e-5)


def test_delaunay_does_not_extrapolate() -> None:
    dense = delaunay(samples((10, 10, 5.0), (10, 30, 5.0), (30, 10, 5.0)), GREY)
    assert dense[15, 15] == pytest.approx(5.0)
    assert dense[40, 40] == 0
    assert dense[5, 20] == 0


@pytest.mark.parametrize("rows", [[], [(10, 10)], [(10, 10), (10, 20), (10, 30)]])
def test_delaunay_needs_three_samples(rows: list[tuple[int, int]]) -> None:
    assert not delaunay(samples(*((v, u, 5.0) for v, u in rows)), GREY).any()


@pytest.mark.parametrize("name", COMPLETIONS.names())
def test_without_samples_there_is_no_depth(name: str) -> None:
    assert not COMPLETIONS.load(name)().complete(np.zeros(SHAPE, np.float32), GREY).any()


def test_nearest_takes_the_nearest_sample() -> None:
    dense = nearest_sample(samples((30, 20, 5.0), (30, 60, 9.0)), GREY)
    np.testing.assert_allclose(dense[:, :40], 5.0, rtol=1e-6)
    np.testing.assert_allclose(dense[:, 41:], 9.0, rtol=1e-6)


def test_ip_basic_prefers_nearer_surfaces_and_leaves_the_sky() -> None:
    near, far = (
        [(v, u, 5.0) for v in (35, 55) for u in range(30)],
        [(v, u, 20.0) for v in (35, 55) for u in range(30, 80)],
    )
    dense = ip_basic(samples(*near, *far), GREY)
    np.testing.assert_allclose(dense[32:58, :29], 5.0, rtol=1e-3)
    np.testing.assert_allclose(dense[32:58, 45:], 20.0, rtol=1e-3)
    assert dense[45, 30] < 6  # where neither was measured
    assert not dense[:5].any()


@given(seed=st.integers(0, 1000), share=st.floats(0.001, 0.2))
@settings(max_examples=10, deadline=None)
def test_completed_depths_are_within_the_measured_range(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    sparse = np.where(random.random(SHAPE) < share, random.uniform(3, 50, SHAPE), 0).astype(np.float32)
    sparse[30, 40] = 10.0
    image = random.integers(0, 256, (*SHAPE, 3), np.uint8)
    known = sparse[sparse > 0]
    for name in COMPLETIONS.names():
        dense = COMPLETIONS.load(name)().complete(sparse, image)
        assert dense.dtype == np.float32
        assert dense.shape == SHAPE
        filled = dense[dense > 0]
        assert filled.min(initial=np.inf) >= known.min() * 0.999
        assert filled.max(initial=0) <= known.max() * 1.001


def test_the_random_field_changes_at_image_edges() -> None:
    halves = np.zeros((*SHAPE, 3), np.uint8)
    halves[:, 50:] = 255
    sparse = samples(*((v, 10, 5.0) for v in range(60)), *((v, 70, 20.0) for v in range(60)))
    guided, plain = 1 / markov_random_field(sparse, halves)[30], 1 / markov_random_field(sparse, GREY)[30]
    whole = 1 / 5 - 1 / 20
    assert guided[48] - guided[52] > 0.5 * whole
    assert plain[48] - plain[52] == pytest.approx(4 / 60 * whole, rel=0.1)  # without an edge, a straight line


@pytest.fixture
def wall(grid: RayGrid) -> SparseScan:
    """Every fourth ring of a wall 15 m ahead of the camera, wider than its image."""
    ring, column = (a.ravel() for a in np.indices(grid.shape))
    rho = 15 / np.maximum(np.cos(grid.azimuth[column]), 0.5)
    xyz = grid.points(rho / np.cos(grid.sensor.elevation[ring]), ring, column)[np.abs(grid.azimuth[column]) < 1]
    ring = ring[np.abs(grid.azimuth[column]) < 1]
    cloud, rings = PointCloud(xyz, np.zeros(len(xyz)), ring=ring), np.arange(64)
    image = np.full((370, 1200, 3), 90, np.uint8)
    return SparseScan(cloud, grid.sensor, rings, lambda: image, CALIBRATION).without(rings[rings % 4 != 0])


@pytest.mark.parametrize("name", COMPLETIONS.names())
def test_depth_completion_is_exact_on_a_wall(name: str, wall: SparseScan, grid: RayGrid) -> None:
    prediction = COMPLETIONS.load(name)()(wall, grid)
    row, column = np.nonzero(prediction.ranges)
    rho = prediction.ranges[row, column] * np.cos(grid.sensor.elevation[row])
    np.testing.assert_allclose(rho * np.cos(grid.azimuth[column]), 15.0, rtol=1e-3)
    assert len(row) > 10_000
    assert np.abs(grid.azimuth[column]).max() < 0.8  # as the image is wide
    assert prediction.trusted[row, column].all()
    assert np.isinf(prediction.sigma[prediction.ranges == 0]).all()


@pytest.mark.parametrize("missing", [{"read_image": lambda: None}, {"calibration": None}], ids=["image", "calibration"])
def test_without_a_camera_there_is_no_prediction(missing: dict[str, Any], wall: SparseScan, grid: RayGrid) -> None:
    prediction = nearest_method()(replace(wall, **missing), grid)
    assert not prediction.ranges.any()
    assert not prediction.trusted.any()


def test_held_out_returns_do_not_leak_into_the_input(wall: SparseScan, grid: RayGrid) -> None:
    """Rays on kept rings are not predicted, nor those above the first return or below the last one."""
    rows = np.flatnonzero(markov_random_field_method()(wall, grid).ranges.any(axis=1))
    assert not set(rows) & set(range(0, 64, 4))
    image = range_image(wall.cloud, grid)
    assert (image[rows] == -1).all()
