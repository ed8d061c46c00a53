from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.data.dataset import open_dataset

DRIVE = "2013_05_28_drive_0000_sync"


@pytest.fixture
def root(tmp_path: Path, hdl64_scan: Callable, write_text: Callable) -> Path:
    """Scans 1 to 3, of which 2 has no pose; the IMU looks ahead with z down, 1 m behind the LiDAR."""
    scans = tmp_path / "data_3d_raw" / DRIVE / "velodyne_points"
    (scans / "data").mkdir(parents=True)
    for number in (1, 2, 3):
        hdl64_scan(columns=20).tofile(scans / "data" / f"{number:010d}.bin")
    write_text(scans / "timestamps.txt", *(f"2013-05-28 08:46:02.{at}04381000" for at in range(4)))
    ahead = [f"{at} 1 0 0 {5 * at} 0 1 0 0 0 0 1 0" for at in (1, 3)]
    write_text(tmp_path / "data_poses" / DRIVE / "poses.txt", *ahead)
    calibration = tmp_path / "calibration"
    # The camera 0.5 m ahead of the IMU, 0.5 m behind the LiDAR; it looks ahead.
    write_text(calibration / "calib_cam_to_pose.txt", "image_00: 0 0 1 0.5 1 0 0 0 0 1 0 0")
    write_text(calibration / "calib_cam_to_velo.txt", "0 0 1 -0.5 -1 0 0 0 0 -1 0 0")
    camera = ("P_rect_00: 552 0 682 0 0 552 238 0 0 0 1 0", "R_rect_00: 1 0 0 0 1 0 0 0 1")
    write_text(calibration / "perspective.txt", "calib_time: 13-Nov-2020 12:00:00", *camera)
    images = tmp_path / "data_2d_raw" / DRIVE / "image_00" / "data_rect"
    images.mkdir(parents=True)
    cv2.imwrite(str(images / "0000000002.png"), np.full((4, 4, 3), 7, np.uint8))
    return tmp_path


def test_a_drive_is_found_from_any_level_and_is_not_kittis(root: Path) -> None:
    for path in (root, root / "data_3d_raw", root / "data_3d_raw" / DRIVE):
        assert open_dataset(path).name == "KITTI-360 2013_05_28_drive_0000"
    assert open_dataset(root, "0").name == "KITTI-360 2013_05_28_drive_0000"


def test_scans_are_kittis_raw_ones_without_kittis_correction(root: Path) -> None:
    data = open_dataset(root)
    assert data.stamps == pytest.approx([0, 0.1, 0.2])
    assert data.sensor is not None
    assert data.sensor.vertical_correction == 0
    cloud = data[0].cloud
    assert cloud.time is not None
    assert [cloud.time.min(), cloud.time.max()] == pytest.approx([-0.05, 0.05], abs=0.01)
    assert cloud.ring is not None
    assert cloud.ring.tolist() == np.repeat(np.arange(64), 20).tolist()


def test_truth_is_by_the_frames_number_and_in_the_lidar(root: Path) -> None:
    data = open_dataset(root)
    truth = data.ground_truth
    assert truth is not None
    assert np.isnan(truth[1]).all()
    assert np.allclose(truth[2], [[1, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert [problem.kind for problem in data.problems] == ["poses shorter than scans"]


def test_the_camera_looks_ahead(root: Path) -> None:
    data = open_dataset(root)
    assert data.calibration is not None
    assert data.calibration.K[0, 2] == 682
    assert (data.calibration.T_camera_lidar @ [10, 1, 2, 1]).tolist() == [-1, -2, 10.5, 1]
    assert [data[at].image is None for at in range(3)] == [True, False, True]
