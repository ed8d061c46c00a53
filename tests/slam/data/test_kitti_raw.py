from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data import oxts, se3
from slam.data.dataset import open_dataset
from slam.data.errors import InputError

IDENTITY = "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n"


def clock(seconds: float) -> str:
    return f"2011-09-26 13:04:{seconds:012.9f}\n"


@pytest.fixture
def drive(tmp_path: Path, hdl64_scan: Callable) -> Path:
    """Six scans, 0.1 s apart, of a car driving north at 10 m/s; OXTS packets 20 ms later than scans."""
    folder = tmp_path / "2011_09_26" / "2011_09_26_drive_0005_sync"
    (folder / "velodyne_points" / "data").mkdir(parents=True)
    (folder / "oxts" / "data").mkdir(parents=True)
    for number in range(6):
        hdl64_scan(columns=90).tofile(folder / "velodyne_points" / "data" / f"{number:010d}.bin")
        latitude = 49 + np.rad2deg((number * 0.1 + 0.02) * 10 / oxts.EARTH_RADIUS)
        packet = f"{latitude:.14f} 8.4 112.0 0 0 {np.pi / 2} " + "0 " * 24
        (folder / "oxts" / "data" / f"{number:010d}.txt").write_text(packet)
    (folder / "velodyne_points" / "timestamps.txt").write_text("".join(clock(32 + 0.1 * n) for n in range(6)))
    (folder / "oxts" / "timestamps.txt").write_text("".join(clock(32.02 + 0.1 * n) for n in range(6)))
    date = folder.parent
    (date / "calib_imu_to_velo.txt").write_text("calib_time: 25-May-2012 16:47:16\n" + IDENTITY)
    (date / "calib_velo_to_cam.txt").write_text("R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 0\n")
    (date / "calib_cam_to_cam.txt").write_text(
        "R_rect_00: 1 0 0 0 1 0 0 0 1\nP_rect_02: 700 0 600 42 0 700 180 0 0 0 1 0\n"
    )
    return folder


def test_truth_is_taken_at_the_scans_time_not_the_packets(drive: Path) -> None:
    dataset = open_dataset(drive)
    assert dataset.ground_truth is not None
    assert dataset.stamps == pytest.approx(np.arange(6) / 10)
    # Forward is the car's x; the first scan lies before the first packet, the rest between two.
    assert dataset.ground_truth[:, 0, 3] == pytest.approx(np.arange(6.0), abs=1e-3)
    assert dataset.ground_truth[:, 1:3, 3] == pytest.approx(0, abs=1e-3)
    assert dataset.problems == ()


def test_scans_have_times_unless_their_maker_deskewed_them(drive: Path) -> None:
    assert open_dataset(drive)[0].cloud.time is not None
    (drive / "sensor.yaml").write_text("model: hdl64\nmotion_compensated: true\n")
    assert open_dataset(drive)[0].cloud.time is None


def test_calibration_is_found_at_either_level(drive: Path) -> None:
    for path in drive.parent.glob("calib_*.txt"):
        path.rename(drive / path.name)
    calibration = open_dataset(drive).calibration
    assert calibration is not None
    assert calibration.T_camera_lidar @ [10, 0, 0, 1] == pytest.approx([0.06, 0, 10, 1])


def test_without_calibration_the_scans_still_run(drive: Path) -> None:
    for path in drive.parent.glob("calib_*.txt"):
        path.unlink()
    dataset = open_dataset(drive)
    assert dataset.calibration is None
    assert dataset.ground_truth is None
    assert [problem.kind for problem in dataset.problems] == ["no calibration", "no ground truth"]
    assert len(dataset[0].cloud) == 64 * 90


@pytest.mark.parametrize("rows", [[0, 1, 4, 5], [0, 1, 2, 3, 4, 5]], ids=["scans that exist", "all frames"])
def test_rows_of_the_clock_count_scans_or_frames(drive: Path, rows: list[int]) -> None:
    for number in (2, 3):
        (drive / "velodyne_points" / "data" / f"{number:010d}.bin").unlink()
    (drive / "velodyne_points" / "timestamps.txt").write_text("".join(clock(32 + 0.1 * n) for n in rows))
    dataset = open_dataset(drive)
    assert dataset.numbers.tolist() == [0, 1, 4, 5]
    assert dataset.stamps == pytest.approx([0, 0.1, 0.4, 0.5])
    assert dataset.ground_truth is not None
    assert dataset.ground_truth[:, 0, 3] == pytest.approx([0, 1, 4, 5], abs=1e-3)
    assert [problem.message.rpartition(": ")[2] for problem in dataset.problems] == ["2-3 (2 in all); the rest is used"]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("velodyne_points/timestamps.txt", clock(1) * 2, "2 rows for 6 scans"),
        ("velodyne_points/timestamps.txt", "noon\n" * 6, "2011-09-26"),
        ("oxts/data/0000000003.txt", "49 8 112", "30 finite numbers"),
        ("oxts/data/0000000003.txt", "north", "not an OXTS packet"),
        ("../calib_imu_to_velo.txt", "R: 1 2\n", "'R: '"),
    ],
)
def test_wrong_files_are_refused_by_name(drive: Path, name: str, text: str, message: str) -> None:
    (drive / name).write_text(text)
    with pytest.raises(InputError, match=Path(name).name) as error:
        open_dataset(drive)
    assert message in str(error.value)


def test_scans_far_from_every_packet_have_no_truth(drive: Path) -> None:
    for number in (3, 4, 5):
        (drive / "oxts" / "data" / f"{number:010d}.txt").unlink()
    dataset = open_dataset(drive)
    assert dataset.ground_truth is not None
    assert np.isnan(dataset.ground_truth[:, 0, 0]).tolist() == [False, False, False, False, True, True]
    assert [problem.kind for problem in dataset.problems] == ["no ground truth"]


def test_packets_whose_clock_stands_still_are_left_out(drive: Path) -> None:
    times = [32.02, 32.12, 32.12, 32.32, 32.42, 32.52]
    (drive / "oxts" / "timestamps.txt").write_text("".join(clock(time) for time in times))
    truth = open_dataset(drive).ground_truth
    assert truth is not None
    assert truth[:, 0, 3] == pytest.approx(np.arange(6.0), abs=1e-3)


def test_poses_are_continued_by_one_step_at_either_end() -> None:
    step = se3.exp(np.array([0, 0, 0.1, 1, 0, 0]))
    poses = np.stack([np.eye(4), step, step @ step])
    found = oxts.poses_at(np.array([0, 0.1, 0.2]), poses, np.array([-0.1, 0.0, 0.3, 1.0]))
    assert found[0] == pytest.approx(se3.inverse(step))
    assert found[1] == pytest.approx(np.eye(4))
    assert found[2] == pytest.approx(step @ step @ step)
    assert np.isnan(found[3]).all()


def test_a_packet_without_a_fix_is_no_pose(drive: Path) -> None:
    """Its zeros lie on the equator, five thousand kilometres away; the packets on either side are near enough."""
    (drive / "oxts" / "data" / "0000000003.txt").write_text("0 0 0 0 0 0 " + "0 " * 24)
    truth = open_dataset(drive).ground_truth
    assert truth is not None
    assert truth[:, 0, 3] == pytest.approx(np.arange(6.0), abs=1e-3)
