"""Edges of scans and of images, by hand."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from slam.calibration.edges import MARK, SIDE, TOP, find_edges
from slam.calibration.fields import edge_fields, pinhole_grey
from slam.data.camera import project
from slam.data.cloud import Array, Calibration, PointCloud

STEP = np.deg2rad(0.2)
K = np.array([[100.0, 0.0, 80.0], [0.0, 100.0, 60.0], [0.0, 0.0, 1.0]])


def rings(ranges: Array, spacing: float = np.deg2rad(0.4), intensity: Array | None = None) -> PointCloud:
    """A scan with a ring for each row of `ranges`, a ray for each column, around the x axis."""
    rays = ranges.shape[1]
    ring, column = np.indices(ranges.shape)
    azimuth, elevation = STEP * (column - rays / 2), -spacing * ring
    flat = ranges * np.cos(elevation)
    xyz = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), ranges * np.sin(elevation)], axis=-1)
    shades = np.zeros(ranges.size) if intensity is None else intensity.ravel()
    return PointCloud(xyz.reshape(-1, 3), shades, ring.ravel())


def wall() -> Array:
    """Ranges of four rings, of which the lower two see a wall at 8 m in front of the background at 30 m."""
    ranges = np.full((4, 20), 30.0)
    ranges[2:, 5:15] = 8.0
    return ranges


def test_a_post_has_two_sides() -> None:
    ranges = np.full((1, 20), 20.0)
    ranges[0, 8:12] = 5.0
    edges = find_edges(rings(ranges))
    assert sorted(edges.near.tolist()) == [8, 11]
    assert (edges.kind == SIDE).all()
    left = edges.step[edges.near == 11][0]
    np.testing.assert_allclose(np.linalg.norm(left), 5.0 * STEP, rtol=1e-3)  # to the next ray, at the post's range
    assert left[1] > 0


def test_the_top_of_a_wall() -> None:
    edges = find_edges(rings(wall()))
    tops = edges.kind == TOP
    assert sorted(edges.near[tops].tolist()) == list(range(45, 55))
    np.testing.assert_allclose(edges.step[tops][:, 2], 8.0 * np.deg2rad(0.4), rtol=0.01)


def test_tops_need_rings_close_by() -> None:
    assert (find_edges(rings(wall(), np.deg2rad(2.0))).kind == SIDE).all()


def test_a_mark_on_a_road() -> None:
    shades = np.full((1, 200), 0.1)
    shades[0, 100:] = 0.7
    edges = find_edges(rings(np.full((1, 200), 9.0), intensity=shades))
    assert edges.near.tolist() == [99]
    assert (edges.kind == MARK).all()


def test_no_points() -> None:
    assert not len(find_edges(PointCloud(np.zeros((0, 3)), np.zeros(0), np.zeros(0))).near)


def test_a_plain_image_has_no_edges() -> None:
    np.testing.assert_allclose(edge_fields(np.full((40, 60), 90, np.uint8), 1.0, 10.0), 0.0, atol=1e-3)


def test_fields_tell_the_direction_of_edges() -> None:
    image = np.zeros((60, 60), np.uint8)
    image[:, 30:] = 200
    upright, level = edge_fields(image, 1.0, 20.0)
    assert upright[30, 30] > 2
    np.testing.assert_allclose(level, 0.0, atol=1e-3)


@pytest.mark.parametrize(("distortion", "fisheye"), [((-0.3, 0.1, 0.0, 0.0), False), ((0.05, 0.0, 0.0, 0.0), True)])
def test_a_lens_is_straightened(distortion: tuple[float, ...], fisheye: bool) -> None:
    """A spot at the pixel that the lens puts a point at is where a pinhole camera has the point."""
    lens = Calibration(K, np.eye(4), distortion, fisheye=fisheye)
    point = np.array([[0.25, -0.2, 1.0]])
    u, v = project(point, lens)[0][0]
    image = np.zeros((120, 160, 3), np.uint8)
    cv2.circle(image, (round(u), round(v)), 2, (255, 255, 255), -1)
    row, column = np.argwhere(pinhole_grey(image, lens) > 200).mean(axis=0)
    expected = project(point, Calibration(K, np.eye(4)))[0][0]
    np.testing.assert_allclose([column, row], expected, atol=1.0)
