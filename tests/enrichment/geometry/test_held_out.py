"""Held-out rings: the input of a method contains nothing of the reference."""

from __future__ import annotations

import numpy as np
import pytest

from enrichment.geometry.held_out import hold_out, ring_step
from enrichment.geometry.rays import Prediction, RayGrid
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.sensor import Sensor, load_sensor

FORWARD = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
CAMERA = Calibration(np.array([[700, 0, 600], [0, 700, 180], [0, 0, 1.0]]), FORWARD)


def frame(cloud: PointCloud, image: Array | None = None) -> Frame:
    return Frame(7, 0.0, cloud, CAMERA, lambda: image)


@pytest.mark.parametrize("phase", [0, 3])
def test_sixteen_rings_are_kept_and_the_others_held_out(dense: PointCloud, grid: RayGrid, phase: int) -> None:
    held = hold_out(frame(dense), grid, phase)
    assert held.scan.cloud.ring is not None
    np.testing.assert_array_equal(held.scan.rings, np.arange(phase, 64, 4))
    assert set(held.scan.cloud.ring) <= set(held.scan.rings)
    assert not set(held.ring) & set(held.scan.rings)
    assert len(held.ring) + len(held.scan.cloud) == len(dense)


def test_predicting_the_recorded_ranges_has_no_error(dense: PointCloud, grid: RayGrid) -> None:
    held = hold_out(frame(dense), grid)
    ranges = np.zeros(grid.shape, np.float32)
    ranges[dense.ring, grid.column_of(dense.xyz)] = grid.range_of(dense.xyz, dense.ring)
    to_the_left = np.tile(grid.azimuth > 0, (len(ranges), 1))
    predicted, sigma, trusted = held.answers(Prediction(ranges, ranges / 100, to_the_left))
    np.testing.assert_allclose(predicted, held.ranges, rtol=1e-6)
    np.testing.assert_allclose(sigma, held.ranges / 100, rtol=1e-6)
    np.testing.assert_array_equal(trusted, grid.azimuth[held.column] > 0)


def test_rays_do_not_depend_on_the_held_out_return(dense: PointCloud, grid: RayGrid) -> None:
    """Returns moved along their own column, up or away: the question stays the same."""
    lifted = dense.with_xyz(dense.xyz * [1.1, 1.1, 0.9])
    ours, theirs = (hold_out(frame(cloud), grid) for cloud in (dense, lifted))
    np.testing.assert_array_equal(ours.ring, theirs.ring)
    np.testing.assert_array_equal(ours.column, theirs.column)
    np.testing.assert_allclose(theirs.ranges, 1.1 * ours.ranges, rtol=1e-5)


def test_seen_marks_returns_visible_to_the_camera(dense: PointCloud, grid: RayGrid) -> None:
    assert hold_out(frame(dense), grid).seen is None
    held = hold_out(frame(dense, np.zeros((375, 1242, 3), np.uint8)), grid)
    assert held.seen is not None
    assert 0.05 < held.seen.mean() < 0.4
    assert (np.abs(grid.azimuth[held.column[held.seen]]) < np.deg2rad(45)).all()


def test_every_second_of_fewer_rings_is_kept() -> None:
    sensor = load_sensor("vlp16")
    assert ring_step(sensor) == 2
    assert ring_step(Sensor("32 rings", np.linspace(0.2, -0.5, 32), np.zeros(32))) == 2
    cloud = PointCloud(np.tile([10.0, 0, 0], (16, 1)), np.zeros(16), ring=np.arange(16))
    held = hold_out(frame(cloud), RayGrid(sensor), 1)
    np.testing.assert_array_equal(held.scan.rings, np.arange(1, 16, 2))
    np.testing.assert_array_equal(held.ring, np.arange(0, 16, 2))


def test_scans_without_rings_are_an_error(grid: RayGrid) -> None:
    with pytest.raises(InputError, match="scan 7"):
        hold_out(frame(PointCloud(np.ones((5, 3)), np.zeros(5))), grid)
