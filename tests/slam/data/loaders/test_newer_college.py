from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import PointCloud
from slam.data.dataset import open_dataset
from slam.data.loaders.newer_college import T_BASE_LIDAR
from slam.data.point_writer import write_points

SECOND = 1583836591


@pytest.fixture
def experiment(tmp_path: Path, write_text: Callable) -> Path:
    """Three scans, one of whose names has lost a zero, and the device's truth: 1 m a scan along its x axis."""
    folder, count = tmp_path / "01_short_experiment", np.arange(64)
    (folder / "raw_format" / "ouster_scan").mkdir(parents=True)
    xyz = np.column_stack([10 + 0 * count, count / 64, 2 - count / 16])
    fields = {"t": (1_500_000 * count).astype(np.uint32), "ring": count.astype(np.uint8)}
    names = [f"{SECOND}_982590976", f"{SECOND + 1}_82590976", f"{SECOND + 1}_182590976"]
    for name in names:
        write_points(folder / "raw_format" / "ouster_scan" / f"cloud_{name}.pcd", PointCloud(xyz, np.ones(64)), fields)
    times = [(SECOND, 982590976), (SECOND + 1, 82590976), (SECOND + 1, 182590976)]
    rows = [f"{s},{ns},{at},0,0,0,0,0,1" for at, (s, ns) in enumerate(times)]
    write_text(folder / "ground_truth" / "registered_poses.csv", "#sec,nsec,x,y,z,qx,qy,qz,qw", *rows)
    return folder


def test_names_are_seconds_and_nanoseconds(experiment: Path) -> None:
    data = open_dataset(experiment)
    assert data.name == "Newer College 01_short_experiment"
    assert data.stamps - SECOND == pytest.approx([0.982590976, 1.082590976, 1.182590976], abs=1e-6)
    cloud = data[0].cloud
    assert cloud.time is not None
    assert cloud.time[[0, 63]] == pytest.approx([0, 0.0945])
    assert cloud.ring is not None
    assert cloud.ring.tolist() == list(range(64))
    assert data.problems == ()


def test_the_truth_is_the_lidars(experiment: Path) -> None:
    """Which is turned in the hand: what is ahead for the device is neither x nor y of the LiDAR."""
    truth = open_dataset(experiment.parent).ground_truth
    assert truth is not None
    assert np.allclose(truth[2, :3, 3], 2 * T_BASE_LIDAR[:3, :3].T[:, 0], atol=1e-9)
    assert np.linalg.norm(truth[2, :3, 3]) == pytest.approx(2)
    assert abs(np.rad2deg(np.arctan2(truth[2, 1, 3], truth[2, 0, 3]))) == pytest.approx(135, abs=0.1)
