"""Ray segments guided by an image."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.methods.joint import Joint
from slam.data.camera import project
from slam.data.cloud import Array, Calibration, PointCloud

# The camera stands where the lasers do: what it sees of the edge is what they see.
LOOKING_AHEAD = np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.16], [1, 0, 0, 0.0], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[700.0, 0, 600], [0, 700.0, 170], [0, 0, 1]]), LOOKING_AHEAD)
BOARD, WALL, TOP = 8.0, 30.0, -0.3  # m: a board across, up to the height TOP, before a wall


@pytest.fixture(scope="module")
def truth(grid: RayGrid) -> Array:
    """(R, W) ranges at which rays meet the board, or the wall above it; within 1 rad of straight ahead."""
    elevation, offset = grid.sensor.elevation[:, None], grid.sensor.offset[:, None]
    ahead = 1 / np.maximum(np.cos(grid.azimuth), 0.5)
    board = np.tan(elevation) * BOARD * ahead + offset < TOP
    ranges = np.where(board, BOARD, WALL) * ahead / np.cos(elevation)
    return np.where(np.abs(grid.azimuth) < 1, ranges, 0)


@pytest.fixture(scope="module")
def scan(grid: RayGrid, truth: Array) -> SparseScan:
    """Every fourth ring of it, and an image of the dark board before the bright wall."""
    row, column = np.nonzero(truth)
    cloud = PointCloud(grid.points(truth[row, column], row, column), np.zeros(len(row)), ring=row)
    horizon = 170 - 700 * (TOP - 0.16) / BOARD  # the row of the board's top: a line, for the board stands across
    image = np.full((370, 1200, 3), 220, np.uint8)
    image[round(horizon) :] = 30
    rings = np.arange(64)
    return SparseScan(cloud, grid.sensor, rings, lambda: image, CALIBRATION).without(rings[rings % 4 != 0])


def changed(joint: Prediction, plain: Prediction) -> Array:
    """(R, W) where the image has moved a ray's end: by more than a millimetre."""
    return np.asarray(np.abs(joint.ranges - plain.ranges) > 1e-3)


def test_rays_end_on_their_side_of_an_image_edge(scan: SparseScan, truth: Array, grid: RayGrid) -> None:
    grey = replace(scan, read_image=lambda: np.full((370, 1200, 3), 128, np.uint8))
    joint = Joint()(scan, grid)
    plain, blind = RaySegment()(scan, grid), Joint()(grey, grid)
    row, column = np.nonzero(changed(joint, plain))
    assert len(set(row)) in range(1, 7)  # of the two gaps between rings that the edge crosses
    error, without_image, without_colour = (
        np.abs(prediction.ranges[row, column] - truth[row, column]).mean() for prediction in (joint, plain, blind)
    )
    assert error < 0.5 * without_image
    assert error < 0.8 * without_colour


@pytest.mark.parametrize("missing", [{"read_image": lambda: None}, {"calibration": None}], ids=["image", "calibration"])
def test_joint_without_a_camera_equals_ray_segment(missing: dict[str, Any], scan: SparseScan, grid: RayGrid) -> None:
    same(Joint()(replace(scan, **missing), grid), RaySegment()(scan, grid))


def test_joint_outside_the_field_of_view_equals_ray_segment(scan: SparseScan, grid: RayGrid) -> None:
    backwards = CALIBRATION.T_camera_lidar @ np.diag([-1.0, -1, 1, 1])
    same(
        Joint()(replace(scan, calibration=replace(CALIBRATION, T_camera_lidar=backwards)), grid),
        RaySegment()(scan, grid),
    )


def test_joint_outside_the_image_equals_ray_segment(scan: SparseScan, grid: RayGrid) -> None:
    plain, joint = RaySegment()(scan, grid), Joint()(scan, grid)
    row, column = np.nonzero(changed(joint, plain))
    pixels, _ = project(grid.points(plain.ranges[row, column], row, column), CALIBRATION)
    assert (pixels[:, 0] > -0.6).all()
    assert (pixels[:, 0] < 1199.6).all()


def test_certain_segments_are_unchanged(scan: SparseScan, truth: Array, grid: RayGrid) -> None:
    """The wall alone is a plane: exact by ray-segment, and not touched."""
    alone = replace(scan, cloud=scan.cloud.select(scan.cloud.xyz[:, 0] > 20))
    plain = RaySegment()(alone, grid)
    same(Joint()(alone, grid), plain)
    known = (plain.ranges > 0) & (np.abs(grid.azimuth) < 0.99)
    np.testing.assert_allclose(plain.ranges[known], truth[known], rtol=0.01)


def test_sigma_grows_with_the_spread_of_guesses(scan: SparseScan, grid: RayGrid) -> None:
    plain, joint = RaySegment()(scan, grid), Joint()(scan, grid)
    assert (joint.sigma[changed(joint, plain)] > 0.02).all()
    assert np.isfinite(joint.sigma[joint.ranges > 0]).all()
    assert joint.trusted[joint.ranges > 0].any()
    assert not joint.trusted[joint.ranges == 0].any()


def test_an_image_without_points_equals_ray_segment(grid: RayGrid, scan: SparseScan) -> None:
    nothing = replace(scan, cloud=scan.cloud.select(np.zeros(len(scan.cloud), bool)))
    same(Joint()(nothing, grid), RaySegment()(nothing, grid))


def same(one: Prediction, other: Prediction) -> None:
    np.testing.assert_array_equal(one.ranges, other.ranges)
    np.testing.assert_array_equal(one.sigma, other.sigma)
    np.testing.assert_array_equal(one.trusted, other.trusted)
