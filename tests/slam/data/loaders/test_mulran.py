from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.loaders.mulran import T_BASE_LIDAR

STAMPS = [1561000444390857630 + 100_000_000 * number for number in range(3)]


@pytest.fixture
def kaist(tmp_path: Path, write_struct: Callable, write_text: Callable) -> Path:
    """Whole images of 64 x 1024 points: the ring falls with the row, the azimuth with the column. The third is cut."""
    row, column = np.tile(np.arange(64), 1024), np.repeat(np.arange(1024), 64)
    azimuth, elevation = -2 * np.pi * column / 1024, np.deg2rad(16.6 - 33.2 * row / 63)
    xyz = 10 * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])
    table = np.column_stack([xyz, 100 + row])
    table[5] = 0  # no return
    for stamp, points in zip(STAMPS, (table, table, table[:-64]), strict=True):
        write_struct(tmp_path / "KAIST01" / "Ouster" / f"{stamp}.bin", "x:f4,y:f4,z:f4,i:f4", points)
    poses = [np.hstack([np.eye(3), [[2.0 * number], [0], [0]]]).ravel() for number in range(6)]
    rows = [f"{STAMPS[0] + 50_000_000 * at}," + ",".join(map(str, pose)) for at, pose in enumerate(poses)]
    write_text(tmp_path / "KAIST01" / "global_pose.csv", *rows)
    return tmp_path


def test_names_are_stamps_and_places_are_rings_and_times(kaist: Path) -> None:
    data = open_dataset(kaist, "KAIST01")
    assert data.name == "MulRan KAIST01"
    assert data.stamps == pytest.approx([stamp / 1e9 for stamp in STAMPS], abs=1e-6)
    cloud = data[0].cloud
    assert len(cloud) == 64 * 1024 - 1
    assert cloud.ring is not None
    assert cloud.ring[:6].tolist() == [0, 1, 2, 3, 4, 6]  # the fifth saw nothing
    assert cloud.time is not None
    assert cloud.time[[0, 62, 63, -1]] == pytest.approx([0, 0, 0.1 / 1024, 0.1 * 1023 / 1024], abs=1e-6)
    assert cloud.intensity[0] == pytest.approx(100 / 255)
    assert data.point_times.stamp == "start"  # type: ignore[attr-defined]


def test_a_scan_that_is_cut_has_neither_and_says_so(kaist: Path) -> None:
    frame = open_dataset(kaist)[2]
    assert frame.cloud.ring is frame.cloud.time is None
    assert [problem.kind for problem in frame.problems] == ["no point times"]


def test_the_truth_is_moved_from_the_base_to_the_lidar_which_looks_backwards(kaist: Path) -> None:
    truth = open_dataset(kaist).ground_truth
    assert truth is not None
    assert np.allclose(truth[0], np.eye(4))
    assert truth[1, :3, 3] == pytest.approx([-4, 0, 0], abs=0.03)  # 2 m in 0.05 s, seen from behind
    assert np.allclose(truth[1, :3, 3], T_BASE_LIDAR[:3, :3].T @ [4, 0, 0])


def test_without_its_marks_a_folder_named_ouster_is_no_drive_of_it(kaist: Path) -> None:
    (kaist / "KAIST01" / "global_pose.csv").unlink()
    assert open_dataset(kaist / "KAIST01" / "Ouster").name == "Ouster"


def test_lines_of_a_later_generation_are_nominal_and_do_not_fit(kaist: Path) -> None:
    """The built-in OS1-64 sees from 22.5 to -22.5 deg, the first generation from 16.6 to -16.6."""
    data = open_dataset(kaist, sensor="os1-64")
    kinds = [problem.kind for problem in data.problems]
    assert kinds[:2] == ["nominal laser lines", "laser lines"]
    assert kinds.count("nominal laser lines") == 1
    assert not any("laser lines" in problem.kind for problem in open_dataset(kaist).problems)
