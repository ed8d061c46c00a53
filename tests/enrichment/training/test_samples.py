"""Samples: what the camera sees of a scan, and where the target depths come from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from enrichment.training.samples import Sample, Source, source
from slam.data.camera import project, visible
from slam.data.cloud import Array, PointCloud
from slam.data.depth_map import DEPTH_SCALE
from slam.data.errors import InputError
from slam.data.pose_files import kitti_text


def first(of: Source) -> Sample:
    sample = next(iter(of))
    assert sample is not None
    return sample


def truth(shape: tuple[int, ...], scale: float, sequence: Any) -> Array:
    """(H, W): the street's depth at the centres of cells, the camera being where the LiDAR is: ground and wall."""
    v = (np.arange(shape[0]) + 0.5) / scale - 0.5
    with np.errstate(divide="ignore"):
        ground = 1.7 * sequence.calibration.K[1, 1] / (v - sequence.calibration.K[1, 2])
    row = np.where((ground > 0) & (ground < 15), ground, 15.0)
    return np.repeat(row[:, None], shape[1], axis=1)


def test_returns_are_the_points_in_the_image(sequence: Any) -> None:
    sample = first(Source(sequence))
    pixels, depth = project(sequence.clouds[0].xyz, sequence.calibration)
    inside = ((pixels > -0.5) & (pixels < (239.5, 79.5))).all(axis=1)
    assert len(sample.returns) == inside.sum() > 3000
    expected = np.column_stack([np.round(pixels[inside]), depth[inside], sequence.clouds[0].ring[inside]])
    found = np.column_stack([sample.returns[name].astype(float) for name in ("column", "row", "depth", "ring")])
    found[:, 2] /= DEPTH_SCALE
    # each has its like among the others: the same ring, within half a pixel and half a step
    order, wanted = np.lexsort(found.T[[2, 1, 0, 3]]), np.lexsort(expected.T[[2, 1, 0, 3]])
    np.testing.assert_allclose(found[order], expected[wanted], atol=0.51 / DEPTH_SCALE)
    assert sample.image.shape == (40, 120, 3)
    assert sample.ring_step == 4


def test_the_target_has_all_rings_that_the_camera_sees(sequence: Any) -> None:
    target = first(Source(sequence, scale=1.0)).target
    pixels, depth = project(sequence.clouds[0].xyz, sequence.calibration)
    seen = visible(pixels, depth, (80, 240))
    column, row = np.round(pixels[seen]).astype(int).T
    known = np.zeros((80, 240), bool)
    known[row, column] = True
    np.testing.assert_array_equal(target > 0, known)
    assert (target[row, column] <= depth[seen] + 0.51 / DEPTH_SCALE).all()


def test_neighbouring_scans_densify_the_target(sequence: Any, dense: PointCloud) -> None:
    even, odd = (dense.select(dense.ring % 2 == parity) for parity in (0, 1))
    sequence = replace(sequence, clouds=[even, odd.with_xyz(odd.xyz - [1, 0, 0])])
    alone, both = first(Source(sequence)).target, first(Source(sequence, sequence.ground_truth)).target
    assert (both > 0).sum() > 1.2 * (alone > 0).sum()
    np.testing.assert_array_equal(both[alone > 0], alone[alone > 0])
    new = (both > 0) & (alone == 0)
    off = np.abs(both - truth(both.shape, 0.5, sequence))[new] / both[new]
    assert np.quantile(off, 0.9) < 0.05  # far down the road a cell spans more


def test_points_of_moving_objects_are_left_out(sequence: Any, dense: PointCloud) -> None:
    even, odd = (dense.select(dense.ring % 2 == parity) for parity in (0, 1))
    car = odd.select((odd.xyz[:, 0] > 14) & (np.abs(odd.xyz[:, 1]) < 3) & (odd.xyz[:, 2] > -0.5))
    car = car.with_xyz(car.xyz - [8, 0, 0])  # 7 m away in the second scan, where the first saw the wall
    sequence = replace(sequence, clouds=[even, car.with_xyz(car.xyz - [1, 0, 0])])
    target = first(Source(sequence, sequence.ground_truth)).target
    np.testing.assert_array_equal(target, first(Source(sequence)).target)


def test_exact_depth_images_are_the_target(sequence: Any) -> None:
    depth = truth((80, 240), 1.0, sequence)
    (sequence.path / "depth_2").mkdir()
    cv2.imwrite(str(sequence.path / "depth_2" / "000010.png"), np.round(depth * 256).astype(np.uint16))
    of = Source(sequence, sequence.ground_truth)
    assert of.target == "exact"
    np.testing.assert_allclose(first(of).target, truth((40, 120), 0.5, sequence), rtol=0.02)


def test_disparity_images_are_the_target(sequence: Any) -> None:
    (sequence.path / "disp_occ_0").mkdir()
    disparity = np.zeros((80, 240), np.uint16)
    disparity[::2, ::2] = 256 * 8  # pixels
    cv2.imwrite(str(sequence.path / "disp_occ_0" / "000010.png"), disparity)
    (sequence.path / "calib.txt").write_text(
        "P2: 720 0 0 44.8 0 720 0 0 0 0 1 0\nP3: 720 0 0 -339.2 0 720 0 0 0 0 1 0\n"
    )
    of = Source(sequence)
    assert of.target == "disparity and returns"
    np.testing.assert_allclose(first(of).target, 384 / 8, rtol=1e-6)


def test_frames_without_an_image_are_skipped(sequence: Any) -> None:
    samples = list(Source(replace(sequence, without_image=frozenset({1}))))
    assert [sample is None for sample in samples] == [False, True, False]


def test_poses_are_read_from_a_file(sequence: Any, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_text(kitti_text(sequence.ground_truth))
    of = source(sequence, path)
    np.testing.assert_allclose(of.poses, sequence.ground_truth, atol=1e-9)
    assert "placed by run.txt" in of.target
    path.write_text(kitti_text(sequence.ground_truth[:2]))
    with pytest.raises(InputError, match=r"run\.txt: 2 poses for the 3 scans"):
        source(sequence, path)


@pytest.mark.parametrize(("what", "fault"), [("calibration", "no camera"), ("sensor", "sensor model is unknown")])
def test_unsuitable_sequences_are_an_error(sequence: Any, what: str, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        Source(replace(sequence, **{what: None}))
