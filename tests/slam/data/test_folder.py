import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.data.cloud import PointCloud
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.point_writer import write_points
from slam.data.sensor import load_sensor

POINTS = np.array([[10, 0, 1, 0.5], [0, 10, 0, 0.25], [-10, 0, -1, 1]], np.float32)
CALIBRATION = """K: [[700, 0, 600], [0, 700, 180], [0, 0, 1]]
T_camera_lidar: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
distortion: [0.1, 0, 0, 0]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three scans of three points, named scan1, scan2 and scan10, and their times."""
    for number in (1, 2, 10):
        (POINTS + number).tofile(tmp_path / f"scan{number}.bin")
    (tmp_path / "times.txt").write_text("0\n0.1\n0.9\n")
    return tmp_path


def kinds(problems: tuple) -> list[str]:
    return [problem.kind for problem in problems]


def write_cloud(path: Path, **fields: np.ndarray) -> None:
    """Without intensity but for what is in `fields`."""
    write_points(path, PointCloud(POINTS[:, :3], np.zeros(3)), fields)
    path.write_bytes(path.read_bytes().replace(b" intensity", b" unused", 1))


def cloud_file(path: Path) -> Path:
    if path.suffix == ".npy":
        np.save(path, POINTS)
    else:
        write_points(path, PointCloud(POINTS[:, :3], POINTS[:, 3]))
    return path


def test_scans_come_in_the_order_of_their_numbers(folder: Path) -> None:
    dataset = open_dataset(folder)
    assert dataset.numbers.tolist() == [1, 2, 10]
    assert dataset.stamps.tolist() == [0, 0.1, 0.9]
    assert [dataset[i].cloud.xyz[0, 0] for i in range(3)] == [11, 12, 20]
    assert kinds(dataset.problems) == ["gap in numbering"]
    assert dataset.sensor is dataset.calibration is dataset.ground_truth is dataset[0].cloud.ring is None


@pytest.mark.parametrize("place", ["scans", "velodyne", "points", "lidar"])
def test_scans_may_lie_in_a_folder_of_their_own(tmp_path: Path, place: str) -> None:
    (tmp_path / place).mkdir()
    POINTS.tofile(tmp_path / place / "1.bin")
    assert len(open_dataset(tmp_path)[0].cloud) == 3


def test_the_raw_layout_of_rko_lio(tmp_path: Path) -> None:
    """lidar/<ns>.ply, imu.csv and transforms.yaml: of these, the scans are read."""
    (tmp_path / "lidar").mkdir()
    for number in range(2):
        time = np.array([0, 0.05, 0.1]) + 1.7e9 + 0.1 * number
        write_cloud(tmp_path / "lidar" / f"{1_700_000_000_000_000_000 + 100_000_000 * number}.ply", t=time)
    (tmp_path / "imu.csv").write_text("timestamp,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n")
    (tmp_path / "transforms.yaml").write_text(
        "T_lidar_to_base: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
    )
    dataset = open_dataset(tmp_path)
    assert dataset.stamps == pytest.approx([1.7e9, 1.7e9 + 0.1])
    assert dataset[1].cloud.time == pytest.approx([0, 0.05, 0.1], abs=1e-6)


def test_names_without_rising_numbers_are_counted(tmp_path: Path) -> None:
    for name in ("b7", "a9", "c"):
        POINTS.tofile(tmp_path / f"{name}.bin")
    dataset = open_dataset(tmp_path)
    assert dataset.numbers.tolist() == [0, 1, 2]
    assert kinds(dataset.problems) == ["no time stamps"]
    assert dataset.stamps == pytest.approx([0, 0.1, 0.2])


@pytest.mark.parametrize("suffix", [".pcd", ".ply"])
def test_fields_are_found_under_their_common_names(tmp_path: Path, suffix: str) -> None:
    write_cloud(
        tmp_path / f"1{suffix}",
        reflectivity=np.array([0, 51, 255], np.float32),
        ring=np.array([2, 1, 0], np.uint16),
        t=np.array([0, 25_000_000, 100_000_000], np.int32),
    )
    cloud = open_dataset(tmp_path)[0].cloud
    assert np.array_equal(cloud.xyz, POINTS[:, :3])
    assert cloud.intensity == pytest.approx([0, 0.2, 1])
    assert cloud.time == pytest.approx([0, 0.025, 0.1])
    # Counted from the bottom in the file, as Velodyne's drivers do: of 16 rings the lowest is 15 here.
    assert cloud.ring is not None
    assert cloud.ring.tolist() == [13, 14, 15]


def test_a_sensor_that_compensates_motion_gives_no_times(tmp_path: Path) -> None:
    write_cloud(tmp_path / "1.pcd", time=np.array([0, 0.05, 0.1], np.float32))
    (tmp_path / "sensor.yaml").write_text("model: vlp16\nmotion_compensated: true\n")
    assert open_dataset(tmp_path)[0].cloud.time is None


def test_rings_from_the_file_count_from_the_top_where_it_does(tmp_path: Path) -> None:
    write_cloud(tmp_path / "1.pcd", ring=np.array([0, 1, 2], np.uint16))
    ring = open_dataset(tmp_path)[0].cloud.ring
    assert ring is not None
    assert ring.tolist() == [0, 1, 2]


def test_rings_that_the_sensor_does_not_have_are_refused(tmp_path: Path) -> None:
    write_cloud(tmp_path / "1.pcd", ring=np.array([0, 1, 31], np.uint16))
    with pytest.raises(InputError, match=r"1\.pcd: rings 0 to 31, but the sensor vlp16 has 16"):
        open_dataset(tmp_path, sensor="vlp16")[0]


def test_rings_come_from_the_laser_lines_of_the_named_sensor(tmp_path: Path) -> None:
    sensor = load_sensor("vlp16")
    rho = np.linspace(5, 50, 16)
    xyz = np.column_stack([rho, np.zeros(16), np.tan(sensor.elevation) * rho + sensor.offset])
    np.save(tmp_path / "1.npy", xyz[::-1])
    assert open_dataset(tmp_path)[0].cloud.ring is None
    ring = open_dataset(tmp_path, sensor="vlp16")[0].cloud.ring
    assert ring is not None
    assert ring.tolist() == list(range(15, -1, -1))


def test_rings_of_scans_in_kittis_order_hold_after_motion_compensation(tmp_path: Path, hdl64_scan: Callable) -> None:
    scan = hdl64_scan()
    scan[:, 2] += 0.03  # off the lines, so that the nearest one is often wrong
    scan.tofile(tmp_path / "1.bin")
    ring = open_dataset(tmp_path, sensor="hdl64")[0].cloud.ring
    assert ring is not None
    assert ring.tolist() == np.repeat(np.arange(64), 360).tolist()


@pytest.mark.parametrize(
    "table",
    [POINTS, POINTS.astype(np.float64), POINTS[:, :3], np.rec.fromarrays(POINTS.T, names="x,y,z,intensity")],
    ids=["float32", "float64", "without intensity", "structured"],
)
def test_npy_scans(tmp_path: Path, table: np.ndarray) -> None:
    np.save(tmp_path / "1.npy", table)
    cloud = open_dataset(tmp_path)[0].cloud
    assert np.array_equal(cloud.xyz, POINTS[:, :3])
    assert cloud.intensity.tolist() in ([0.5, 0.25, 1], [0, 0, 0])


def test_a_pickle_is_never_executed(tmp_path: Path) -> None:
    np.save(tmp_path / "1.npy", np.array([{}], object), allow_pickle=True)
    with pytest.raises(InputError, match="Python objects"):
        open_dataset(tmp_path)[0]


@pytest.mark.parametrize("table", [np.zeros((2, 7)), np.zeros(4), np.zeros((2, 3), "U1")])
def test_arrays_that_are_no_points_are_refused(tmp_path: Path, table: np.ndarray) -> None:
    np.save(tmp_path / "1.npy", table)
    with pytest.raises(InputError, match="N x 4"):
        open_dataset(tmp_path)[0]


@pytest.mark.parametrize("suffix", [".pcd", ".ply", ".npy"])
@pytest.mark.parametrize("content", [b"", b"nothing of the kind"])
def test_damaged_files_give_an_empty_cloud_and_a_problem(tmp_path: Path, suffix: str, content: bytes) -> None:
    for number in (0, 3):
        shutil.copy(cloud_file(tmp_path / f"cloud{suffix}"), tmp_path / f"{number}{suffix}")
    (tmp_path / f"cloud{suffix}").unlink()
    for number in (1, 2):
        (tmp_path / f"{number}{suffix}").write_bytes(content)
    frames = list(open_dataset(tmp_path))  # type: ignore[call-overload]
    assert [len(frame.cloud) for frame in frames] == [3, 0, 0, 3]
    assert kinds(frames[1].problems) == ["missing scan"]
    assert f"1{suffix}" in frames[1].problems[0].message


@pytest.mark.parametrize("suffix", [".pcd", ".ply", ".npy"])
def test_a_folder_is_refused_where_none_of_the_first_scans_can_be_read(tmp_path: Path, suffix: str) -> None:
    for number in range(4):
        (tmp_path / f"{number}{suffix}").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match=rf"0\{suffix}: cannot be read .*; nor can the next 2$"):
        open_dataset(tmp_path)


def test_returns_at_the_origin_are_no_returns_and_nan_is_counted(tmp_path: Path) -> None:
    scan = np.array([[0, 0, 0, 0], [np.nan, 1, 1, 0], [5, 1, 1, 0]], np.float32)
    np.save(tmp_path / "1.npy", scan)
    frame = open_dataset(tmp_path)[0]
    assert frame.cloud.xyz.tolist() == [[5, 1, 1]]
    assert kinds(frame.problems) == ["non-finite points"]


def test_images_are_matched_by_time_where_they_have_times(folder: Path) -> None:
    (folder / "images").mkdir()
    for number, shade in enumerate((10, 20, 30)):
        cv2.imwrite(str(folder / "images" / f"{number}.png"), np.full((4, 4, 3), shade, np.uint8))
    (folder / "images" / "times.txt").write_text("-5\n0.08\n0.91\n")
    (folder / "calib.yaml").write_text(CALIBRATION)
    dataset = open_dataset(folder)
    frames = [dataset[i] for i in range(3)]
    assert [None if frame.image is None else int(frame.image[0, 0, 0]) for frame in frames] == [20, 20, 30]
    (folder / "images" / "times.txt").write_text("-5\n0.08\n9\n")
    assert kinds(open_dataset(folder)[2].problems) == ["missing image"]


def test_images_are_matched_by_name_otherwise(folder: Path) -> None:
    (folder / "image_2").mkdir()
    cv2.imwrite(str(folder / "image_2" / "scan2.jpg"), np.full((4, 4, 3), 50, np.uint8))
    dataset = open_dataset(folder)
    assert [dataset[i].image is None for i in range(3)] == [True, False, True]
    assert "no calibration" in kinds(dataset.problems)


def test_calibration_is_read_and_checked(folder: Path) -> None:
    path = folder / "calib.yaml"
    path.write_text(CALIBRATION)
    calibration = open_dataset(folder).calibration
    assert calibration is not None
    assert calibration.distortion == (0.1, 0, 0, 0)
    assert calibration.T_camera_lidar[2, 0] == 1
    for right, wrong, message in [
        ("T_camera_lidar", "T_lidar_camera", "did you mean 'T_camera_lidar'"),
        ("[1, 0, 0, 0]", "[2, 0, 0, 0]", "must be a rotation"),
        ("[[0, -1, 0, 0]", "[[0, 1, 0, 0]", "must be a rotation"),
        ("[700, 0, 600]", "[0, 0, 600]", "fx and fy"),
        ("[0, 0, 1]]", "[0, 0, 1], [0, 0, 0]]", "3 x 3"),
        ("[0.1, 0, 0, 0]", "[0.1]", "distortion coefficients"),
        ("K:", "k:", "unknown key 'k'"),
    ]:
        path.write_text(CALIBRATION.replace(right, wrong, 1))
        with pytest.raises(InputError, match=r"calib\.yaml") as error:
            open_dataset(folder)
        assert message in str(error.value)


def test_images_of_16_bits_have_a_common_brightness_scale(folder: Path) -> None:
    """12 bits in use: a dark image is dark, as it would not be by its own brightest pixel."""
    (folder / "images").mkdir()
    for name, brightest in (("scan1", 400), ("scan2", 4000), ("scan10", 800)):
        cv2.imwrite(str(folder / "images" / f"{name}.png"), np.full((4, 4), brightest, np.uint16))
    (folder / "calib.yaml").write_text(CALIBRATION)
    images = [open_dataset(folder)[position].image for position in range(3)]
    assert [None if image is None else image[0, 0].tolist() for image in images] == [[25] * 3, [250] * 3, [50] * 3]


AHEAD = "[[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]"
TO_THE_LEFT = "[[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]"
TWO_CAMERAS = f"""cameras:
  left: {{K: [[100, 0, 5], [0, 100, 5], [0, 0, 1]], T_camera_lidar: {TO_THE_LEFT}, model: fisheye}}
  front: {{K: [[200, 0, 5], [0, 200, 5], [0, 0, 1]], T_camera_lidar: {AHEAD}, images: ahead}}
"""


def two_cameras(folder: Path) -> None:
    (folder / "calib.yaml").write_text(TWO_CAMERAS)
    for place, shade in (("images/left", 10), ("ahead", 20)):
        (folder / place).mkdir(parents=True)
        for name in ("scan1", "scan10"):
            cv2.imwrite(str(folder / place / f"{name}.png"), np.full((10, 10, 3), shade, np.uint8))


def test_of_several_cameras_the_one_that_looks_ahead_is_the_frames_own(folder: Path) -> None:
    two_cameras(folder)
    dataset = open_dataset(folder)
    assert dataset.calibration is not None
    assert dataset.calibration.K[0, 0] == 200
    frame = dataset[0]
    assert frame.image is not None
    assert frame.image[0, 0, 0] == 20
    assert [view.calibration.fisheye for view in frame.views] == [False, True]
    left = frame.others[0].read_image()
    assert left is not None
    assert left[0, 0, 0] == 10
    assert kinds(dataset[1].problems) == ["missing image", "missing image"]
    assert set(dataset.folders) == {folder, folder / "ahead", folder / "images" / "left"}  # type: ignore[attr-defined]


def test_a_camera_without_its_folder_is_left_out_and_that_is_said(folder: Path) -> None:
    two_cameras(folder)
    shutil.rmtree(folder / "ahead")
    dataset = open_dataset(folder)
    assert dataset.calibration is not None
    assert dataset.calibration.fisheye
    assert dataset[0].others == ()
    assert "no images" in kinds(dataset.problems)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("cameras: {}", "'cameras': names are expected"),
        ("cameras: [1]", "'cameras': names are expected"),
        ("cameras: {front: 3}", "'cameras.front': lines like"),
        ("cameras: {front: {K: 1, image: x}}", "unknown key 'cameras.front.image'; did you mean 'images'"),
        ("cameras: {front: {T_camera_lidar: 1}}", "'cameras.front.K' is missing"),
        (f"{TWO_CAMERAS}model: pinhole", "'model' beside 'cameras'; put it under the name"),
    ],
)
def test_cameras_that_make_no_sense_are_refused(folder: Path, content: str, message: str) -> None:
    (folder / "calib.yaml").write_text(content)
    with pytest.raises(InputError, match=r"calib\.yaml") as error:
        open_dataset(folder)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ("0\n1\n", "2 rows for 3 scans"),
        ("a\nb\nc\n", "one number per line"),
    ],
)
def test_times_that_make_no_sense_are_refused(folder: Path, times: str, message: str) -> None:
    (folder / "times.txt").write_text(times)
    with pytest.raises(InputError, match=r"times\.txt") as error:
        open_dataset(folder)
    assert message in str(error.value)


def test_truth_by_row_or_by_time(folder: Path) -> None:
    path = folder / "poses.txt"
    path.write_text("".join(f"1 0 0 {x} 0 1 0 0 0 0 1 0\n" for x in (5, 6, 7)))
    truth = open_dataset(folder).ground_truth
    assert truth is not None
    assert truth[:, 0, 3].tolist() == [0, 1, 2]
    path.write_text("0 0 0 0 0 0 0 1\n0.5 5 0 0 0 0 0 1\n")
    dataset = open_dataset(folder)
    assert dataset.ground_truth is not None
    assert dataset.ground_truth[:2, 0, 3] == pytest.approx([0, 1])
    assert np.isnan(dataset.ground_truth[2]).all()
    assert "poses shorter than scans" in kinds(dataset.problems)


def test_truth_of_more_frames_than_there_are_scans_goes_by_the_scans_numbers(folder: Path) -> None:
    """Stamps of frames 0 to 11, of which 1, 2 and 10 exist."""
    (folder / "poses.txt").write_text("".join(f"1 0 0 {x**2} 0 1 0 0 0 0 1 0\n" for x in range(12)))
    dataset = open_dataset(folder)
    assert dataset.ground_truth is not None
    assert dataset.ground_truth[:, 0, 3] == pytest.approx([0, 2**2 - 1, 10**2 - 1])
    assert kinds(dataset.problems) == ["gap in numbering"]


def test_scans_of_two_kinds_are_refused(folder: Path) -> None:
    np.save(folder / "1.npy", POINTS)
    with pytest.raises(InputError, match="several kinds"):
        open_dataset(folder)
