import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError

FIRST = 315973157959879000  # ns
LOG = "0b86f508-5df9-4a46-bc59-5b9536dbde9f"


def write_feather(file: Path, **columns: Any) -> None:
    arrow = pytest.importorskip("pyarrow")
    from pyarrow import feather

    file.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(arrow.table(columns), str(file))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Two scans of the car's frame; the upper LiDAR is 1 m ahead of it and 2 m above, and turned to the left."""
    folder, half = tmp_path / "val" / LOG, 0.5**0.5
    points = {
        **{"x": np.array([3, 1], np.float16), "y": np.array([0, 4], np.float16), "z": np.array([2, 1], np.float16)},
        "intensity": np.array([51, 102], np.uint8),
        "laser_number": np.array([3, 40], np.uint8),
        "offset_ns": np.array([0, 90_000_000], np.int32),
    }
    for number in range(2):
        write_feather(folder / "sensors" / "lidar" / f"{FIRST + 100_000_000 * number}.feather", **points)
    write_feather(
        folder / "calibration" / "egovehicle_SE3_sensor.feather",
        sensor_name=["up_lidar", "ring_front_center"],
        **{"qw": [half, 0.5], "qx": [0, -0.5], "qy": [0, 0.5], "qz": [half, -0.5]},
        **{"tx_m": [1.0, 1.5], "ty_m": [0.0, 0.0], "tz_m": [2.0, 1.5]},
    )
    intrinsics = {"fx_px": [1776.0], "fy_px": [1776.0], "cx_px": [777.0], "cy_px": [1013.0], "k1": [-0.3]}
    write_feather(folder / "calibration" / "intrinsics.feather", sensor_name=["ring_front_center"], **intrinsics)
    stamps = [FIRST + 50_000_000 * at for at in range(4)]
    still = {"qw": [1.0] * 4, "qx": [0.0] * 4, "qy": [0.0] * 4, "qz": [0.0] * 4}
    way = {"tx_m": [700.0, 701.0, 702.0, 703.0], "ty_m": [0.0] * 4, "tz_m": [0.0] * 4}
    write_feather(folder / "city_SE3_egovehicle.feather", timestamp_ns=stamps, **still, **way)
    images = folder / "sensors" / "cameras" / "ring_front_center"
    images.mkdir(parents=True)
    cv2.imwrite(str(images / f"{FIRST + 10_000_000}.jpg"), np.full((8, 8, 3), 100, np.uint8))
    return tmp_path


def test_points_and_truth_are_the_upper_lidars(log: Path) -> None:
    data = open_dataset(log)
    assert data.name == f"Argoverse 2 {LOG}"
    assert data.stamps == pytest.approx([FIRST / 1e9, FIRST / 1e9 + 0.1])
    cloud = data[0].cloud
    assert np.allclose(cloud.xyz, [[0, -2, 0], [4, 0, -1]], atol=1e-6)
    assert cloud.intensity == pytest.approx([0.2, 0.4])
    assert cloud.ring is cloud.time is None
    assert data.point_times.stamp == "start"  # type: ignore[attr-defined]
    assert data.ground_truth is not None
    assert np.allclose(data.ground_truth[1, :3, 3], [0, -2, 0])  # ahead, for a LiDAR that looks to the left


def test_the_front_camera(log: Path) -> None:
    data = open_dataset(log / "val" / LOG)
    assert data.calibration is not None
    assert data.calibration.K.tolist() == [[1776, 0, 777], [0, 1776, 1013], [0, 0, 1]]
    assert data.calibration.distortion == ()
    assert np.allclose(data.calibration.T_camera_lidar @ [0, -10, 0, 1], [0, -0.5, 9.5, 1])
    assert [data[at].image is None for at in range(2)] == [False, True]


def test_a_damaged_scan_is_missing(log: Path) -> None:
    (log / "val" / LOG / "sensors" / "lidar" / f"{FIRST + 100_000_000}.feather").write_bytes(b"nothing of the kind")
    frame = open_dataset(log)[1]
    assert len(frame.cloud) == 0
    assert [problem.kind for problem in frame.problems] == ["missing scan", "missing image"]


def test_without_calibration_all_stays_in_the_cars_frame(log: Path) -> None:
    (log / "val" / LOG / "calibration" / "egovehicle_SE3_sensor.feather").unlink()
    data = open_dataset(log)
    assert np.allclose(data[0].cloud.xyz, [[3, 0, 2], [1, 4, 1]])
    assert [problem.kind for problem in data.problems] == ["no calibration"]


def test_without_pyarrow_the_remedy_is_said(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pip install 'lidarlift\[argoverse\]'"):
        open_dataset(log)
