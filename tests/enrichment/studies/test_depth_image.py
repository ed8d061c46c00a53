"""Dense depth images, and where depth jumps in them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from enrichment.studies.depth_image import DepthImage, discontinuities, exact, jumps, of_scan
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError

FORWARD = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
CAMERA = Calibration(np.array([[700, 0, 310], [0, 700, 90], [0, 0, 1.0]]), FORWARD)
IMAGE = np.zeros((190, 620, 3), np.uint8)


def step(axis: int, at: int, near: float = 10, far: float = 20) -> Array:
    """Near before `at`, far behind it."""
    depth = np.full((60, 80), float(near))
    depth[(slice(at, None), slice(None)) if axis == 0 else (slice(None), slice(at, None))] = far
    return depth


@pytest.mark.parametrize("axis", [0, 1])
def test_a_step_is_located(axis: int) -> None:
    found = discontinuities(step(axis, 40))
    assert set(np.nonzero(found[axis])[axis]) <= {39, 40}
    assert found[axis].any(axis=axis).all()
    assert not found[1 - axis].any()
    assert jumps(step(axis, 40))[axis].max() == pytest.approx(0.5)


@pytest.mark.parametrize(("far", "found"), [(10.9, False), (11.3, True)])
def test_steps_above_ten_percent_are_discontinuities(far: float, found: bool) -> None:
    assert discontinuities(step(1, 40, 10, far)).any() == found


def test_planes_have_no_discontinuities() -> None:
    """The ground, a wall along the road, and where the two meet."""
    row, column = np.mgrid[1:121, 1:401].astype(float)
    ground, wall = 1.7 * 700 / row, 3.0 * 700 / column
    assert jumps(ground).max() < 1e-9
    for depth in (ground, wall, np.minimum(ground, wall)):
        depth = depth[20:, 20:]
        assert not discontinuities(depth).any()


def test_depth_is_interpolated_between_returns(dense: PointCloud) -> None:
    """A wall at 15 m and the ground before it, in front of the camera."""
    image, (rows, columns) = of_scan(Frame(3, 0.0, dense, CAMERA, lambda: IMAGE))
    assert image.number == 3
    assert image.depth.shape == image.known.shape == image.image.shape[:2]
    assert image.depth.shape == (rows.stop - rows.start, columns.stop - columns.start)
    assert image.known.mean() > 0.9
    v = np.arange(rows.start, rows.stop)[:, None] - 90
    expected = np.minimum(15.0, 1.7 * 700 / np.maximum(v, 1)) * np.ones(image.depth.shape)
    assert np.median(np.abs(image.depth - expected)) < 0.01
    assert np.abs(image.depth - expected)[image.known].mean() < 0.05


def test_a_frame_without_an_image_is_an_error(dense: PointCloud) -> None:
    with pytest.raises(InputError, match="scan 3"):
        of_scan(Frame(3, 0.0, dense, CAMERA, lambda: None))


def test_a_camera_that_sees_no_returns_is_an_error(dense: PointCloud) -> None:
    upwards = Calibration(CAMERA.K, np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    with pytest.raises(InputError, match="calibration"):
        of_scan(Frame(3, 0.0, dense, upwards, lambda: IMAGE))


def test_exact_depth_of_a_simulation_is_read(tmp_path: Path) -> None:
    """Cut out as the scan's, the sky and what is very far at 80 m."""
    window = (slice(1, 3), slice(0, 2))
    scan = DepthImage(np.ones((2, 2)), np.ones((2, 2), bool), np.zeros((2, 2, 3), np.uint8), 4)
    assert exact(tmp_path, scan, window) is None
    (tmp_path / "depth_2").mkdir()
    values = np.array([[9, 9, 9], [0, 2, 9], [100, 3, 9]]) * 256
    cv2.imwrite(str(tmp_path / "depth_2" / "000004.png"), values.astype(np.uint16))
    found = exact(tmp_path, scan, window)
    assert found is not None
    np.testing.assert_array_equal(found.depth, [[80, 2], [80, 3]])
