"""Rays in images: what is read at a ray's pixel is its point's depth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from enrichment.geometry.image_rays import between_returns, project_scan, rays_before_camera
from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.camera import nearest_pixel, project
from slam.data.cloud import Array, Calibration, PointCloud
from slam.data.sensor import Sensor

SHAPE = (80, 160)
# A camera 0.3 m before, 0.1 m left of and 0.2 m below the LiDAR, looking ahead.
LOOKING_AHEAD = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[100.0, 0, 80], [0, 100.0, 40], [0, 0, 1]]), LOOKING_AHEAD)


@pytest.fixture(scope="module")
def small() -> RayGrid:
    """Lines from 8 degrees up to 24 degrees down."""
    return RayGrid(Sensor("small", np.deg2rad(np.linspace(8, -24, 9)), np.linspace(0.1, 0.2, 9)))


def smooth_depth() -> Array:
    """(H, W): between 6 and 14 m."""
    v, u = np.indices(SHAPE)
    return np.asarray(10 + 2 * np.sin(u / 30) + 2 * np.cos(v / 25), np.float32)


def test_intersections_project_to_their_depth(small: RayGrid) -> None:
    dense = smooth_depth()
    rays = rays_before_camera(small, np.ones(small.shape, bool), CALIBRATION, SHAPE)
    ranges = rays.intersect(dense)
    met = np.isfinite(ranges)
    assert met.sum() > 1000
    points = small.points(ranges[met], rays.row[met], rays.column[met])
    pixels, depth = project(points, CALIBRATION)
    inverse = map_coordinates(1 / dense, pixels.T[::-1], order=1, mode="nearest")
    np.testing.assert_allclose(depth, 1 / inverse, rtol=1e-3)
    np.testing.assert_allclose(pixels, rays.pixels(ranges)[met], atol=1e-3)


def test_rays_outside_the_image_have_no_intersection(small: RayGrid) -> None:
    rays = rays_before_camera(small, np.ones(small.shape, bool), CALIBRATION, SHAPE)
    ranges = rays.intersect(smooth_depth())
    u, v = rays.pixels(np.nan_to_num(ranges, nan=10.0)).T
    inside = (u >= -0.5) & (u < 159.5) & (v >= -0.5) & (v < 79.5)
    assert np.isnan(ranges[~inside]).all()
    assert 0 < (~inside).sum() < len(inside)
    assert np.abs(small.azimuth[rays.column]).max() < np.pi / 2  # none behind the camera


def test_pixels_without_depth_have_no_intersection(small: RayGrid) -> None:
    dense = smooth_depth()
    dense[:, 80:] = 0
    rays = rays_before_camera(small, np.ones(small.shape, bool), CALIBRATION, SHAPE)
    ranges = rays.intersect(dense)
    u = rays.pixels(np.nan_to_num(ranges, nan=10.0))[:, 0]
    assert np.isnan(ranges[u > 82]).all()
    assert np.isfinite(ranges[(u > 3) & (u < 76)]).mean() > 0.5


def test_only_wanted_rays_are_selected(small: RayGrid) -> None:
    wanted = np.zeros(small.shape, bool)
    wanted[4, [0, 990, 1000]] = True  # column 0 looks back
    rays = rays_before_camera(small, wanted, CALIBRATION, SHAPE)
    assert (rays.row.tolist(), rays.column.tolist()) == ([4, 4], [990, 1000])


def scan_of(xyz: list[tuple[float, float, float]], grid: RayGrid) -> SparseScan:
    ring = np.arange(len(xyz))
    cloud = PointCloud(np.array(xyz), np.zeros(len(xyz)), ring=ring)
    return SparseScan(cloud, grid.sensor, ring, lambda: np.zeros((*SHAPE, 3), np.uint8), CALIBRATION)


def test_projection_keeps_the_nearest_visible_point(small: RayGrid) -> None:
    def at(u: float, v: float, depth: float) -> tuple[float, float, float]:
        return depth + 0.3, 0.1 - (u - 80) / 100 * depth, -0.2 - (v - 40) / 100 * depth

    seen = project_scan(
        scan_of([at(30, 20, 9.0), at(30, 20, 8.5), at(100.4, 50.4, 6.0), at(101, 53, 20.0), at(500, 9, 5.0)], small)
    )
    assert seen.shown.tolist() == [True, True, True, False, False]
    assert sorted(zip(*np.nonzero(seen.image), strict=True)) == [(20, 30), (50, 100)]
    assert seen.image[20, 30] == pytest.approx(8.5)
    assert seen.image[50, 100] == pytest.approx(6.0)


def test_between_returns_needs_both_returns(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    scan = sparse(0)
    upper = scan.rows_above(grid.sensor)
    between = between_returns(scan, grid)
    for row in range(64):
        returns = scan.points[[upper[row], upper[row] + 1]] >= 0 if upper[row] >= 0 else np.zeros((2, 2000), bool)
        np.testing.assert_array_equal(between[row], returns.all(axis=0))
    assert between.any()


def test_pixel_centres_are_at_integers() -> None:
    u, v = nearest_pixel(np.array([[0.4, 2.6], [-0.4, 3.5]]))
    assert (u.tolist(), v.tolist()) == ([0, 0], [3, 4])
