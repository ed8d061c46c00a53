from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import PointCloud
from slam.data.dataset import open_dataset
from slam.data.point_writer import write_points


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    folder, count = tmp_path / "00", np.arange(100)
    (folder / "frames").mkdir(parents=True)
    azimuth = np.pi - 2 * np.pi * count / 100
    xyz = np.column_stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), 0.01 * count])
    for number in range(3):
        cloud, fields = PointCloud(xyz, np.ones(100)), {"timestamp": (-0.05 + count / 1000).astype(np.float32)}
        write_points(folder / "frames" / f"frame_{number:05d}.ply", cloud, fields)
    (folder / "gt_traj_lidar.txt").write_text("0 0 0\n1 0 0\n2 0 0\n")
    return folder


def test_times_are_from_the_middle_of_the_turn_and_stamps_assumed(sequence: Path) -> None:
    data = open_dataset(sequence)
    assert data.name == "ParisLuco 00"
    assert data.numbers.tolist() == [0, 1, 2]
    assert data.stamps == pytest.approx([0, 0.1, 0.2])
    cloud = data[0].cloud
    assert cloud.time is not None
    assert cloud.time[[0, 50, 99]] == pytest.approx([-0.05, 0, 0.049], abs=1e-6)
    assert data.point_times.stamp == "middle"  # type: ignore[attr-defined]
    assert cloud.ring is not None
    assert cloud.ring[[0, 99]].tolist() == [8, 4]  # level is the ninth of the 32 lasers, 5.7 deg up the fifth


def test_positions_alone_are_no_truth_and_that_is_said(sequence: Path) -> None:
    data = open_dataset(sequence.parent)
    assert data.ground_truth is None
    assert [problem.kind for problem in data.problems] == ["no time stamps", "no ground truth"]
