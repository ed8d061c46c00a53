from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.data.dataset import open_dataset

FIRST = 1606417097528152  # us
HEADER = "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x"


@pytest.fixture
def sequence(tmp_path: Path, write_struct: Callable, write_text: Callable) -> Path:
    """Two scans with times around the stamp, truth that turns, and an image 20 ms after the second scan."""
    folder, count = tmp_path / "boreas-2020-11-26-13-58", np.arange(60)
    elevation = np.deg2rad(10 - count / 4)
    points = [10 + 0 * count, 1 + 0 * count, 10 * np.tan(elevation), 51 + 0 * count, count, -0.05 + count / 590]
    for number in range(2):
        file = folder / "lidar" / f"{FIRST + 100_000 * number}.bin"
        write_struct(file, "x:f4,y:f4,z:f4,i:f4,r:f4,t:f4", np.column_stack(points))
    rows = [f"{FIRST + 100_000 * at},{at},0,0,0,0,0,0,0,{-np.pi / 2 * at},0,0,0" for at in range(2)]
    write_text(folder / "applanix" / "lidar_poses.csv", HEADER, *rows)
    write_text(folder / "calib" / "P_camera.txt", "700 0 600 0", "0 700 180 0", "0 0 1 0", "0 0 0 1")
    write_text(folder / "calib" / "T_camera_lidar.txt", "0 -1 0 0.5", "0 0 -1 0", "1 0 0 0", "0 0 0 1")
    (folder / "camera").mkdir()
    cv2.imwrite(str(folder / "camera" / f"{FIRST + 120_000}.png"), np.full((4, 4, 3), 9, np.uint8))
    cv2.imwrite(str(folder / "camera" / f"{FIRST + 220_000}.png"), np.full((4, 4, 3), 8, np.uint8))
    return folder


def test_points_have_rings_and_times_from_the_middle(sequence: Path) -> None:
    data = open_dataset(sequence)
    assert data.name == "Boreas 2020-11-26-13-58"
    assert data.sensor is not None
    assert data.sensor.name == "vls128"
    cloud = data[0].cloud
    assert data.stamps == pytest.approx([FIRST / 1e6, FIRST / 1e6 + 0.1])
    assert cloud.time is not None
    assert cloud.time[[0, 59]] == pytest.approx([-0.05, 0.05], abs=1e-3)
    assert data.point_times.stamp == "middle"  # type: ignore[attr-defined]
    assert cloud.ring is not None
    assert (np.diff(cloud.ring) > 0).all()


def test_the_truth_is_read_as_pyboreas_reads_it(sequence: Path) -> None:
    """Its yaw(h) is [[cos h, sin h, 0], [-sin h, cos h, 0], [0, 0, 1]]."""
    truth = open_dataset(sequence).ground_truth
    assert truth is not None
    assert np.allclose(truth[1], [[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-9)


def test_the_camera_is_matched_by_time(sequence: Path) -> None:
    data = open_dataset(sequence)
    assert data.calibration is not None
    assert data.calibration.K.tolist() == [[700, 0, 600], [0, 700, 180], [0, 0, 1]]
    assert data.calibration.T_camera_lidar[0].tolist() == [0, -1, 0, 0.5]
    image = data[1].image
    assert image is not None
    assert image[0, 0, 0] == 9
    assert [problem.kind for problem in data[0].problems] == ["missing image"]


def test_a_test_sequence_has_no_truth(sequence: Path) -> None:
    (sequence / "applanix" / "lidar_poses.csv").unlink()
    data = open_dataset(sequence.parent)
    assert data.ground_truth is None
    assert data.problems == ()
