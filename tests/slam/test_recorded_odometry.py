"""Recorded poses of another odometry."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.pose_files import kitti_text, tum_text
from slam.pipeline import Pipeline
from slam.recorded_odometry import RecordedOdometry
from slam.source import sweep_duration

Drive = Callable[..., Path]


def test_the_poses_are_not_changed(street_drive: Drive, street_poses: Array, tmp_path: Path) -> None:
    elsewhere = se3.exp(np.array([0.1, 0.2, 0.3, 4, 5, 6]))
    (tmp_path / "poses.txt").write_text(kitti_text(elsewhere @ street_poses))
    data = open_dataset(street_drive())
    run = Pipeline().run(data, recorded=RecordedOdometry(tmp_path / "poses.txt", len(data)))
    np.testing.assert_allclose(run.poses, street_poses, atol=1e-6)
    assert run.counts()["registered"] == 8
    assert len(run.map) > 1000
    assert np.abs(run.map.xyz[:, 1]).max() < 15  # the walls of the street, at their true positions


def test_a_slice_of_the_sequence_has_its_poses(street_drive: Drive, street_poses: Array, tmp_path: Path) -> None:
    stamps = 1000 + 0.5 * np.arange(8)
    (tmp_path / "poses.txt").write_text(tum_text(stamps, street_poses))
    data = open_dataset(street_drive())
    run = Pipeline().run(data, slice(3, 6), recorded=RecordedOdometry(tmp_path / "poses.txt", len(data)))
    np.testing.assert_allclose(run.poses, se3.inverse(street_poses[3]) @ street_poses[3:6], atol=1e-6)
    np.testing.assert_allclose(run.stamps, stamps[3:6])


def test_the_sweep_duration_is_from_the_stamps_of_the_poses(
    street_drive: Drive, street_poses: Array, tmp_path: Path
) -> None:
    """The sequence has no stamps: 10 Hz is assumed, and the poses show one scan every two seconds."""
    path = street_drive()
    (path / "times.txt").unlink()
    (tmp_path / "poses.txt").write_text(tum_text(2.0 * np.arange(8), street_poses))
    data, recorded = open_dataset(path), RecordedOdometry(tmp_path / "poses.txt", 8)
    assert sweep_duration(data, recorded.stamps) == pytest.approx(2.0)
    assert [problem.kind for problem in Pipeline().run(data, recorded=recorded).problems] == ["no time stamps"]


def test_too_few_poses_are_an_error(street_poses: Array, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text(kitti_text(street_poses[:5]))
    with pytest.raises(InputError, match=r"poses\.txt: 5 poses for 8 scans; give one pose per scan"):
        RecordedOdometry(tmp_path / "poses.txt", 8)


def test_stamps_that_do_not_rise_are_an_error(street_poses: Array, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text(tum_text(np.array([0, 1, 2, 2, 3, 4, 5, 6.0]), street_poses))
    with pytest.raises(InputError, match="the stamp of line 4 is not later"):
        RecordedOdometry(tmp_path / "poses.txt", 8)
