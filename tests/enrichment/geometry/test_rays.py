"""Rays, and the range image of a scan."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enrichment.geometry.rays import RayGrid, columns_for, range_image
from slam.data.cloud import PointCloud
from slam.data.errors import InputError
from slam.data.sensor import load_sensor

GRID = RayGrid(load_sensor("hdl64"))


@given(
    ring=st.lists(st.integers(0, 63), min_size=1, max_size=20),
    seed=st.integers(0, 1000),
)
def test_a_point_on_a_ray_has_its_range_ring_and_column(ring: list[int], seed: int) -> None:
    rng, rings = np.random.default_rng(seed), np.array(ring)
    column, ranges = rng.integers(0, GRID.columns, len(rings)), rng.uniform(1, 90, len(rings))
    xyz = GRID.points(ranges, rings, column)
    assert xyz.dtype == np.float32
    np.testing.assert_array_equal(GRID.column_of(xyz), column)
    np.testing.assert_allclose(GRID.range_of(xyz, rings), ranges, rtol=1e-5)


def test_points_and_range_image_are_equivalent(dense: PointCloud) -> None:
    image = range_image(dense, GRID)
    assert (image >= 0).sum() == len(dense)
    row, column = np.nonzero(image >= 0)
    points = dense.select(image[row, column])
    np.testing.assert_array_equal(points.ring, row)
    np.testing.assert_array_equal(GRID.column_of(points.xyz), column)
    assert sorted(image[row, column]) == list(range(len(dense)))


def test_range_images_use_ring_indices_not_elevation() -> None:
    cloud = PointCloud(np.array([[10.0, 0.1, 5.0]]), np.zeros(1), ring=np.array([60]))
    assert np.argwhere(range_image(cloud, GRID) == 0).tolist() == [[60, GRID.column_of(cloud.xyz)[0]]]


def test_the_nearer_of_two_points_on_a_ray_is_kept() -> None:
    cloud = PointCloud(np.array([[20.0, 0.1, 0], [10.0, 0.05, 0], [15.0, 0.075, 0]]), np.zeros(3), ring=np.full(3, 7))
    assert range_image(cloud, GRID).max() == 1


def test_columns_wrap_around_at_the_back() -> None:
    xyz = np.array([[-1, 0.0, 0], [-1, -0.0, 0], [-1, 1e-4, 0], [-1, -1e-4, 0]])
    assert GRID.column_of(xyz.astype(np.float32)).tolist() == [1999, 0, 1999, 0]


@pytest.mark.parametrize("ring", [None, np.array([64]), np.array([-1])])
def test_a_range_image_without_rings_is_an_error(ring: np.ndarray | None) -> None:
    with pytest.raises(InputError):
        range_image(PointCloud(np.ones((1, 3)), np.zeros(1), ring=ring), GRID)


@pytest.mark.parametrize(("fired", "columns"), [(900, 900), (2083, 2000), (100, 360)])
def test_columns_follow_from_the_azimuth_step(fired: int, columns: int) -> None:
    angle = np.linspace(-np.pi, np.pi, fired, endpoint=False)
    xyz = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), np.zeros(fired)])
    half = PointCloud(xyz[: fired // 2], np.zeros(fired // 2), ring=np.full(fired // 2, 3))  # the rest saw the sky
    assert columns_for(half) == pytest.approx(columns, abs=1)


def test_an_empty_scan_has_the_default_columns() -> None:
    assert columns_for(PointCloud(np.zeros((0, 3)), np.zeros(0), ring=np.zeros(0))) == 2000
