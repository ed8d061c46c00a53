from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError


def kinds(problems: tuple) -> list[str]:
    return [problem.kind for problem in problems]


def test_a_sequence_in_part_uses_its_own_lines(odometry_root: Path) -> None:
    (odometry_root / "sequences" / "04" / "velodyne" / "000000.bin").unlink()
    dataset = open_dataset(odometry_root)
    assert dataset.name == "KITTI odometry 04"
    assert dataset.numbers.tolist() == [1, 2]
    assert dataset.stamps.tolist() == [0.2, 0.4]
    assert dataset.problems == ()
    assert [dataset[i].index for i in range(len(dataset))] == [1, 2]


def test_truth_is_the_lidars_and_begins_at_identity(odometry_root: Path) -> None:
    truth = open_dataset(odometry_root).ground_truth
    assert truth is not None
    assert truth[0] == pytest.approx(np.eye(4))
    # The camera looks along z, which is the LiDAR's x.
    assert truth[2, :3, 3] == pytest.approx([2, 0, 0])


def test_the_camera_is_number_2(odometry_root: Path) -> None:
    calibration = open_dataset(odometry_root).calibration
    assert calibration is not None
    assert calibration.K.tolist() == [[700, 0, 600], [0, 700, 180], [0, 0, 1]]
    # P2 @ Tr @ X: 10 m ahead of the LiDAR.
    x, y, w = calibration.K @ (calibration.T_camera_lidar @ [10, 0, 0, 1])[:3]
    assert (x / w, y / w) == pytest.approx(((700 * 0.1 + 600 * 10.3 + 42) / 10.3, (700 * 0.2 + 180 * 10.3) / 10.3))
    assert calibration.T_camera0_lidar is not None
    assert calibration.T_camera0_lidar[:3, 3].tolist() == [0.1, 0.2, 0.3]


def test_a_frame_holds_points_as_recorded(odometry_root: Path, hdl64_scan: Callable) -> None:
    frame = open_dataset(odometry_root)[1]
    assert np.array_equal(frame.cloud.xyz, hdl64_scan()[:, :3])
    assert frame.cloud.ring is not None
    assert np.unique(frame.cloud.ring).tolist() == list(range(64))
    assert frame.cloud.time is None  # motion-compensated by KITTI
    assert frame.image is None
    assert frame.problems == ()


def test_the_sensor_is_kittis_unless_someone_says_otherwise(odometry_root: Path) -> None:
    sensor = open_dataset(odometry_root).sensor
    assert sensor is not None
    assert sensor.motion_compensated
    assert np.rad2deg(sensor.vertical_correction) == pytest.approx(0.205)
    (odometry_root / "sequences" / "04" / "sensor.yaml").write_text("model: hdl64\n")
    sensor = open_dataset(odometry_root).sensor
    assert sensor is not None
    assert not sensor.motion_compensated
    assert sensor.vertical_correction == 0
    assert open_dataset(odometry_root)[0].cloud.time is not None


def test_a_named_sensor_brings_its_lasers_and_a_file_everything(odometry_root: Path, tmp_path: Path) -> None:
    data = open_dataset(odometry_root, sensor="vlp16")
    named = data.sensor
    assert named is not None
    assert named.ring_count == 16
    assert named.motion_compensated  # as KITTI's scans are, for any sensor: reported
    assert named.vertical_correction == 0  # KITTI's is that of its HDL-64E
    assert [problem.kind for problem in data.problems] == ["motion assumed"]
    assert "motion_compensated: false" in data.problems[0].message
    ours = open_dataset(odometry_root, sensor="hdl64e")
    assert ours.problems == ()
    assert ours.sensor is not None
    assert np.rad2deg(ours.sensor.vertical_correction) == pytest.approx(0.205)
    (tmp_path / "mine.yaml").write_text("model: hdl64\n")
    data = open_dataset(odometry_root, sensor=tmp_path / "mine.yaml")
    filed = data.sensor
    assert filed is not None
    assert data.problems == ()
    assert not filed.motion_compensated


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_images_are_read_when_asked_for_and_missed_when_not_there(odometry_root: Path, suffix: str) -> None:
    folder = odometry_root / "sequences" / "04" / "image_2"
    folder.mkdir()
    red = np.zeros((20, 30, 3), np.uint8)
    red[:, :, 2] = 255  # OpenCV writes blue first
    cv2.imwrite(str(folder / f"000001{suffix}"), red)
    (folder / f"000002{suffix}").touch()
    dataset = open_dataset(odometry_root)
    assert [kinds(dataset[i].problems) for i in range(3)] == [["missing image"], [], ["missing image"]]
    image = dataset[1].image
    assert image is not None
    assert image.shape == (20, 30, 3)
    assert image[10, 10, 0] > 250
    assert dataset[0].image is None
    assert dataset[2].image is None


def test_without_calibration_scans_still_run(odometry_root: Path) -> None:
    (odometry_root / "sequences" / "04" / "calib.txt").unlink()
    dataset = open_dataset(odometry_root)
    assert dataset.calibration is None
    assert dataset.ground_truth is None
    assert kinds(dataset.problems) == ["no calibration", "no ground truth"]
    assert "calib.txt" in dataset.problems[1].message
    assert len(dataset[0].cloud) == 64 * 360


def test_calibration_without_tr_is_reported(odometry_root: Path) -> None:
    (odometry_root / "sequences" / "04" / "calib.txt").write_text("P2: 700 0 600 42 0 700 180 0 0 0 1 0\n")
    assert "'Tr:'" in open_dataset(odometry_root).problems[0].message


def test_a_broken_calibration_is_refused(odometry_root: Path) -> None:
    (odometry_root / "sequences" / "04" / "calib.txt").write_text("P2: 1 2 3\nTr: 1 2 3\n")
    with pytest.raises(InputError, match=r"calib\.txt.*12 numbers"):
        open_dataset(odometry_root)


def test_poses_shorter_than_scans_leave_the_rest_without_truth(odometry_root: Path) -> None:
    (odometry_root / "poses" / "04.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n")
    dataset = open_dataset(odometry_root)
    assert dataset.ground_truth is not None
    assert np.isnan(dataset.ground_truth).any(axis=(1, 2)).tolist() == [False, False, True]
    assert kinds(dataset.problems) == ["poses shorter than scans"]


@pytest.mark.parametrize("times", [None, "0\n0.1\n", "7\n7\n7\n"], ids=["none", "too few", "all the same"])
def test_without_times_ten_scans_a_second_are_assumed_and_said(odometry_root: Path, times: str | None) -> None:
    path = odometry_root / "sequences" / "04" / "times.txt"
    path.unlink() if times is None else path.write_text(times)
    dataset = open_dataset(odometry_root)
    assert dataset.stamps == pytest.approx([0, 0.1, 0.2])
    assert kinds(dataset.problems) == ["no time stamps"]


def test_a_gap_in_the_numbering_is_named(odometry_root: Path) -> None:
    (odometry_root / "sequences" / "04" / "velodyne" / "000001.bin").unlink()
    dataset = open_dataset(odometry_root)
    assert kinds(dataset.problems) == ["gap in numbering"]
    assert "numbers missing: 1 (1 in all)" in dataset.problems[0].message
    assert dataset.stamps.tolist() == [0, 0.4]


def test_damaged_scans_give_what_is_sound_in_them(odometry_root: Path, hdl64_scan: Callable) -> None:
    folder = odometry_root / "sequences" / "04" / "velodyne"
    (folder / "000000.bin").write_bytes(hdl64_scan().tobytes()[:-9])
    scan = hdl64_scan()
    scan[5, 1], scan[7, 2], scan[9, 0], scan[20, 3] = np.nan, np.inf, 1e20, np.nan
    scan.tofile(folder / "000001.bin")
    (folder / "000002.bin").write_bytes(b"")
    dataset = open_dataset(odometry_root)
    truncated, strange, empty = dataset[0], dataset[1], dataset[2]
    assert kinds(truncated.problems) == ["truncated scan"]
    assert "000000.bin" in truncated.problems[0].message
    assert "7 bytes" in truncated.problems[0].message
    assert len(truncated.cloud) == 64 * 360 - 1
    assert kinds(strange.problems) == ["non-finite points"]
    assert "3 of 23040 points" in strange.problems[0].message
    assert len(strange.cloud) == 64 * 360 - 3
    assert np.isfinite(strange.cloud.xyz).all()
    assert np.isfinite(strange.cloud.intensity).all()
    assert kinds(empty.problems) == ["empty scan"]
    assert len(empty.cloud) == 0


def test_a_scan_that_vanishes_is_a_problem_of_its_frame(odometry_root: Path) -> None:
    dataset = open_dataset(odometry_root)
    (odometry_root / "sequences" / "04" / "velodyne" / "000001.bin").unlink()
    assert kinds(dataset[1].problems) == ["missing scan"]


def test_a_scan_of_39_rings_keeps_their_true_numbers(odometry_root: Path, hdl64_scan: Callable) -> None:
    hdl64_scan(range(39), 1800).tofile(odometry_root / "sequences" / "04" / "velodyne" / "000001.bin")
    frame = open_dataset(odometry_root)[1]
    assert kinds(frame.problems) == ["ring count"]
    assert "39 rings" in frame.problems[0].message
    assert frame.cloud.ring is not None
    assert frame.cloud.ring.tolist() == np.repeat(np.arange(39), 1800).tolist()


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("P2: 0 0 600 0 0 0 180 0 0 0 1 0", "no positive focal lengths"),
        ("P2: -700 0 600 0 0 700 180 0 0 0 1 0", "no positive focal lengths"),
        ("P2: nan 0 600 0 0 700 180 0 0 0 1 0", "calib.txt"),
        ("Tr: 0 1 0 0.1 0 0 -1 0.2 1 0 0 0.3", "not a rotation"),
        ("Tr: 0 -2 0 0.1 0 0 -2 0.2 2 0 0 0.3", "not a rotation"),
        ("Tr: 0 0 0 0 0 0 0 0 0 0 0 0", "not a rotation"),
    ],
)
def test_a_calibration_of_no_camera_is_refused(odometry_root: Path, line: str, fault: str) -> None:
    path = odometry_root / "sequences" / "04" / "calib.txt"
    others = [kept for kept in path.read_text().splitlines() if not kept.startswith(line[:3])]
    path.write_text("\n".join([*others, line]) + "\n")
    with pytest.raises(InputError, match=fault):
        open_dataset(odometry_root)
