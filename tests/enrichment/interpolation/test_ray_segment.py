"""Interpolation between the rings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from enrichment.geometry.rays import RayGrid, range_image
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from slam.data.cloud import PointCloud

Scan = Callable[..., SparseScan]


@pytest.mark.parametrize("phase", [0, 1, 2, 3])
def test_ray_segment_is_exact_on_planes(sparse: Scan, dense: PointCloud, grid: RayGrid, phase: int) -> None:
    prediction = RaySegment()(sparse(phase), grid)
    image = range_image(dense, grid)
    assert dense.ring is not None
    truth = np.where(image >= 0, grid.range_of(dense.xyz, dense.ring)[image], np.nan)
    predicted = prediction.ranges > 0
    error = np.abs(prediction.ranges - truth)[predicted & (image >= 0)]
    assert predicted.sum() > 30_000
    assert np.mean(error < 2e-3) > 0.9  # the rest lies between the ground's last ring and the wall's first one
    assert np.median(prediction.sigma[predicted]) < 1.0


def test_ray_segment_predicts_between_two_returns_only(sparse: Scan, grid: RayGrid) -> None:
    prediction = RaySegment()(sparse(2), grid)
    rows = np.flatnonzero((prediction.ranges > 0).any(axis=1))
    assert rows.min() > 2
    assert rows.max() < 62
    assert not set(rows) & set(range(2, 64, 4))
    assert np.isinf(prediction.sigma[prediction.ranges == 0]).all()
    assert not prediction.trusted[prediction.ranges == 0].any()


def one_column(rho: list[float], z: list[float], grid: RayGrid) -> SparseScan:
    """Returns of rings 0, 4, 8 .. straight ahead."""
    azimuth = grid.azimuth[1000]
    xyz = np.column_stack([np.array(rho) * np.cos(azimuth), np.array(rho) * np.sin(azimuth), z])
    rings = np.arange(len(rho)) * 4
    return SparseScan(PointCloud(xyz, np.zeros(len(rho)), ring=rings), grid.sensor, rings)


def line(grid: RayGrid, ring: int, rho: float) -> float:
    return float(np.tan(grid.sensor.elevation[ring]) * rho + grid.sensor.offset[ring])


def test_segments_between_object_and_background_are_not_trusted(grid: RayGrid) -> None:
    heights = [line(grid, ring, rho) for ring, rho in ((0, 30.0), (4, 24.0))]
    prediction = RaySegment()(one_column([30.0, 24.0], heights, grid), grid)
    assert (prediction.ranges[1:4, 1000] > 0).all()
    assert not prediction.trusted[1:4, 1000].any() or prediction.sigma[1:4, 1000].min() > 1.0


def test_short_segments_are_trusted_and_straight_ones_have_a_smaller_sigma(grid: RayGrid) -> None:
    straight = [10.0, 10.0, 10.0, 10.0]
    bent = [10.0, 10.0, 9.6, 10.0]
    found = {}
    for name, rho in (("straight", straight), ("bent", bent)):
        heights = [line(grid, 4 * k, r) for k, r in enumerate(rho)]
        prediction = RaySegment()(one_column(rho, heights, grid), grid)
        assert prediction.trusted[5:8, 1000].all()
        found[name] = prediction.sigma[6, 1000]
    assert found["straight"] < found["bent"]


def test_missing_returns_are_taken_from_adjacent_columns(grid: RayGrid) -> None:
    scan = one_column([10.0, 10.0], [line(grid, 0, 10.0), line(grid, 4, 10.0)], grid)
    ranges = RaySegment()(scan, grid).ranges
    assert np.flatnonzero(ranges[2] > 0).tolist() == [998, 999, 1000, 1001, 1002]


def test_an_empty_scan_has_no_predictions(grid: RayGrid) -> None:
    empty = PointCloud(np.zeros((0, 3)), np.zeros(0), ring=np.zeros(0))
    assert not RaySegment()(SparseScan(empty, grid.sensor, np.arange(0, 64, 4)), grid).trusted.any()


def test_held_out_returns_do_not_leak_into_the_input(sparse: Scan, dense: PointCloud, grid: RayGrid) -> None:
    """Predictions depend on the kept rings only: a query is the line of its ring, not the direction of a return."""
    assert dense.ring is not None
    moved = dense.xyz * np.where(dense.ring % 4 == 0, 1.0, 0.7)[:, None]
    rings = np.arange(64)
    other = SparseScan(dense.with_xyz(moved), grid.sensor, rings).without(rings[rings % 4 != 0])
    np.testing.assert_array_equal(RaySegment()(other, grid).ranges, RaySegment()(sparse(0), grid).ranges)
