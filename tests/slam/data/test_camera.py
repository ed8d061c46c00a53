"""Projection against numbers done by hand and against OpenCV's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slam.data.camera import project, visible, with_colour, with_colours
from slam.data.cloud import Array, Calibration, Frame, PointCloud, View

# A camera 0.2 m before and 0.1 m below the LiDAR, looking ahead.
LOOKING_AHEAD = np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.1], [1, 0, 0, -0.2], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[100.0, 0, 50], [0, 110.0, 40], [0, 0, 1]]), LOOKING_AHEAD)
SHAPE = (80, 100)


def cloud(*points: tuple[float, float, float]) -> PointCloud:
    return PointCloud(np.array(points, float).reshape(-1, 3), np.zeros(len(points)))


def at(u: float, v: float, depth: float) -> tuple[float, float, float]:
    """The LiDAR's point that is seen in a pixel."""
    return depth + 0.2, -(u - 50) / 100 * depth, -0.1 - (v - 40) / 110 * depth


def seen(*points: tuple[float, float, float]) -> list[bool]:
    answer: list[bool] = visible(*project(cloud(*points).xyz, CALIBRATION), SHAPE).tolist()
    return answer


def test_pixels_and_depth_by_hand() -> None:
    """5 m before the camera, 1 m to the left of it, 0.5 m above it."""
    pixels, depth = project(np.array([[5.2, 1.0, 0.4]]), CALIBRATION)
    assert pixels[0] == pytest.approx([50 - 100 / 5, 40 - 110 * 0.5 / 5])
    assert depth == pytest.approx([5.0])


def test_points_behind_the_camera_have_no_pixel() -> None:
    pixels, depth = project(np.array([[-5.0, 0.0, 0.0], [0.2, 0.0, 0.0]]), CALIBRATION)
    assert np.isnan(pixels).all()
    assert depth == pytest.approx([-5.2, 0.0])


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_distortion_is_opencvs(count: int) -> None:
    import cv2

    coefficients = (-0.3, 0.1, 0.001, -0.002, -0.02, 0.05, 0.01, 0.003, 0.001, 0.002, 0.003, 0.004, 0.01, 0.02)
    distortion = coefficients[:count]
    xyz = np.random.default_rng(0).uniform((4, -2, -2), (20, 2, 2), (200, 3))
    pixels, _ = project(xyz, replace(CALIBRATION, distortion=distortion))
    R, t = cv2.Rodrigues(LOOKING_AHEAD[:3, :3])[0], LOOKING_AHEAD[:3, 3]
    expected, _ = cv2.projectPoints(xyz, R, t, CALIBRATION.K, np.array(distortion))
    np.testing.assert_allclose(pixels, expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("coefficients", [(), (-0.02, 0.01, -0.005, 0.001)])
def test_a_fisheye_is_opencvs(coefficients: tuple[float, ...]) -> None:
    """To 80 degrees off the axis."""
    import cv2

    rng = np.random.default_rng(0)
    off, around, reach = rng.uniform(0, np.deg2rad(80), 200), rng.uniform(0, 2 * np.pi, 200), rng.uniform(2, 30, 200)
    seen = reach[:, None] * np.column_stack([np.sin(off) * np.cos(around), np.sin(off) * np.sin(around), np.cos(off)])
    xyz = (seen - LOOKING_AHEAD[:3, 3]) @ LOOKING_AHEAD[:3, :3]
    pixels, depth = project(xyz, replace(CALIBRATION, distortion=coefficients, fisheye=True))
    K, D = CALIBRATION.K, np.array(coefficients or (0.0,) * 4)
    expected, _ = cv2.fisheye.projectPoints(seen[:, None], np.zeros(3), np.zeros(3), K, D)
    np.testing.assert_allclose(pixels, expected[:, 0], atol=1e-9)
    np.testing.assert_allclose(depth, seen[:, 2])


def test_a_fisheye_by_hand() -> None:
    """45 degrees to the left, and straight ahead: in the middle."""
    pixels, _ = project(np.array([[5.2, 5.0, -0.1], [5.2, 0, -0.1]]), replace(CALIBRATION, fisheye=True))
    np.testing.assert_allclose(pixels, [[50 - 100 * np.pi / 4, 40], [50, 40]])


def test_a_fisheyes_colours_are_where_it_draws_them() -> None:
    image = np.zeros((100, 300, 3), np.uint8)
    image[40, 150 - 79] = (10, 20, 30)  # 45 degrees to the left; a pinhole camera would draw it at 150 - 100
    K = np.array([[100.0, 0, 150], [0, 100.0, 40], [0, 0, 1]])
    points = cloud((5.2, 5.0, -0.1))
    for fisheye, colour in ((True, [10, 20, 30]), (False, [1, 1, 1])):
        coloured = with_colour(points, image, Calibration(K, LOOKING_AHEAD, fisheye=fisheye)).colour
        assert coloured is not None
        assert coloured.tolist() == [colour]


def test_a_fisheye_model_does_not_fold_the_outside_into_the_image() -> None:
    """t (1 - 0.3 t^2) is largest at t = 1.054, 60.4 degrees off the axis."""
    folding = replace(CALIBRATION, fisheye=True, distortion=(-0.3, 0.0, 0.0, 0.0))
    left = 5 * np.tan(np.deg2rad([60, 61]))
    pixels, _ = project(np.column_stack([[5.2, 5.2], left, [-0.1, -0.1]]), folding)
    assert np.isfinite(pixels[0]).all()
    assert np.isnan(pixels[1]).all()


def test_a_lens_model_does_not_fold_the_outside_into_the_image() -> None:
    """r (1 - 0.3 r^2) is 0 again at r = 1.83, so that a point 61 degrees off the axis would fall on its middle."""
    folding = replace(CALIBRATION, distortion=(-0.3, 0.0, 0.0, 0.0))
    pixels, depth = project(np.array([[5.2, -1.826 * 5, -0.1], [5.2, 0.0, -0.1]]), folding)
    assert visible(pixels, depth, SHAPE).tolist() == [False, True]


def test_the_image_ends_half_a_pixel_beyond_its_outermost_centres() -> None:
    inside = [at(-0.49, 40, 5), at(99.49, 40, 5), at(50, -0.49, 5), at(50, 79.49, 5)]
    outside = [at(-0.51, 40, 5), at(99.51, 40, 5), at(50, -0.51, 5), at(50, 79.51, 5)]
    assert seen(*inside) == [True] * 4
    assert seen(*outside) == [False] * 4


@pytest.mark.parametrize(
    ("columns", "rows", "behind", "hidden"),
    [
        (0, 0, 1.1, True),
        (0, 0, 0.9, False),  # a slope, not another thing
        (3, 4, 1.1, True),
        (4, 0, 1.1, False),
        (0, 5, 1.1, False),
        (-3, -4, 1.1, True),
    ],
)
def test_a_nearer_return_close_by_hides_a_point(columns: int, rows: int, behind: float, hidden: bool) -> None:
    assert seen(at(50, 40, 10), at(50 + columns, 40 + rows, 10 + behind)) == [True, not hidden]


def test_far_away_a_twentieth_of_the_depth_counts() -> None:
    """At 60 m, 3 m."""
    assert seen(at(50, 40, 57.2), at(50, 40, 60)) == [True, True]
    assert seen(at(50, 40, 56.8), at(50, 40, 60)) == [True, False]


def test_each_point_has_the_colour_of_its_pixel() -> None:
    image: Array = np.random.default_rng(0).integers(1, 256, (*SHAPE, 3), dtype=np.uint8)
    pixels = [(3, 5), (60.4, 70.4), (98.6, 0)]
    points = cloud(*(at(*pixel, 8) for pixel in pixels), at(20, 20, 8), at(21, 21, 12), (-5, 0, 0))
    coloured = with_colour(points, image, CALIBRATION)
    assert coloured.colour is not None
    expected = [image[5, 3], image[70, 60], image[0, 99], image[20, 20], (0, 0, 0), (0, 0, 0)]
    np.testing.assert_array_equal(coloured.colour, expected)
    np.testing.assert_array_equal(coloured.xyz, points.xyz)


def test_black_that_is_seen_differs_from_unseen() -> None:
    coloured = with_colour(cloud(at(50, 40, 8), (-5, 0, 0)), np.zeros((*SHAPE, 3), np.uint8), CALIBRATION)
    assert coloured.colour is not None
    assert coloured.colour.tolist() == [[1, 1, 1], [0, 0, 0]]


def test_no_points() -> None:
    coloured = with_colour(cloud(), np.zeros((*SHAPE, 3), np.uint8), CALIBRATION)
    assert coloured.colour is not None
    assert coloured.colour.shape == (0, 3)


def test_each_point_has_the_colour_of_the_first_camera_that_saw_it() -> None:
    backwards = Calibration(CALIBRATION.K, LOOKING_AHEAD @ np.diag([-1.0, -1, 1, 1]))
    red, blue = (np.full((*SHAPE, 3), colour, np.uint8) for colour in ((200, 0, 0), (0, 0, 200)))
    points = cloud((5, 0, 0), (-5, 0, 0), (0, 5, 0))
    views = [View(CALIBRATION, lambda: red), View(CALIBRATION, lambda: blue), View(backwards, lambda: blue)]
    colour = with_colours(points, views).colour
    assert colour is not None
    assert colour.tolist() == [[200, 0, 0], [0, 0, 200], [0, 0, 0]]
    assert with_colours(points, [View(CALIBRATION, lambda: None)]).colour is None


def test_the_image_of_a_frame_is_read_once() -> None:
    read = []

    def image() -> Array:
        read.append(1)
        return np.full((*SHAPE, 3), 7, np.uint8)

    frame = Frame(0, 0.0, cloud((5, 0, 0)), CALIBRATION, image)
    assert frame.image is frame.image is frame.views[0].read_image()
    colour = with_colours(frame.cloud, frame.views).colour
    assert colour is not None
    assert colour.tolist() == [[7, 7, 7]]
    assert len(read) == 1
