import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError

FIRST = 1532402927647951  # us
AHEAD_LEFT_UP = [[10.0, 2.0, 1.0], [5.0, 0.0, -1.0], [-8.0, 1.0, 0.5], [4.0, -3.0, -0.5]]  # in our axes
HALF = 0.5**0.5


def data_record(name: str, at: int, sensor: str, sample: str = "sample0") -> dict[str, Any]:
    suffix = "pcd.bin" if "LIDAR" in name else "jpg"
    return {
        "token": f"{name}{at}",
        "sample_token": sample,
        "ego_pose_token": f"ego{at}",
        "calibrated_sensor_token": sensor,
        "timestamp": FIRST + at,
        "filename": f"sweeps/{name}/n008__{name}__{FIRST + at}.{suffix}",
    }


@pytest.fixture
def root(tmp_path: Path, write_struct: Callable) -> Path:
    """Scene 61: three sweeps of which the tables are not in order; the car drives north, 1 m in 50 ms. A radar, and
    another scene's scan, are not its."""
    steps = (0, 100_000, 50_000)
    scans = [data_record("LIDAR_TOP", at, "lidar") for at in steps]
    images = [data_record("CAM_FRONT", at, "camera") for at in (-5_000, 60_000)]
    others = [data_record("RADAR_FRONT", 0, "radar"), data_record("LIDAR_TOP", 10_000, "lidar", "elsewhere")]
    north = [HALF, 0, 0, HALF]  # w first
    tables = {
        "scene": [{"token": "a", "name": "scene-0061"}, {"token": "b", "name": "scene-0103"}],
        "sample": [{"token": "sample0", "scene_token": "a"}, {"token": "elsewhere", "scene_token": "b"}],
        "sample_data": [*scans, *images, *others],
        "ego_pose": [{"token": f"ego{at}", "translation": [7, at / 50_000, 0], "rotation": north} for at in steps],
        "calibrated_sensor": [
            {"token": "lidar", "translation": [1, 0, 2], "rotation": [HALF, 0, 0, -HALF], "camera_intrinsic": []},
            {
                "token": "camera",
                "translation": [1.5, 0, 1.5],
                "rotation": [0.5, -0.5, 0.5, -0.5],
                "camera_intrinsic": [[1266, 0, 816], [0, 1266, 491], [0, 0, 1]],
            },
        ],
    }
    (tmp_path / "v1.0-mini").mkdir()
    for name, rows in tables.items():
        (tmp_path / "v1.0-mini" / f"{name}.json").write_text(json.dumps(rows))
    points = [[-left, ahead, up, 51, ring] for ring, (ahead, left, up) in enumerate(AHEAD_LEFT_UP)]
    for scan in scans:
        write_struct(tmp_path / scan["filename"], "x:f4,y:f4,z:f4,i:f4,r:f4", np.array(points))
    for shade, image in enumerate(images):
        (tmp_path / image["filename"]).parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(tmp_path / image["filename"]), np.full((8, 8, 3), 100 + shade, np.uint8))
    return tmp_path


def test_sweeps_of_a_scene_in_the_order_of_time(root: Path) -> None:
    data = open_dataset(root, "scene-0061")
    assert open_dataset(root, "61").name == data.name == "nuScenes scene-0061"
    assert data.stamps - FIRST / 1e6 == pytest.approx([0, 0.05, 0.1], abs=1e-6)
    assert data.point_times.stamp == "end"  # type: ignore[attr-defined]
    assert data[0].cloud.time is None


def test_axes_are_ours(root: Path) -> None:
    cloud = open_dataset(root, "61")[0].cloud
    assert cloud.xyz.tolist() == AHEAD_LEFT_UP
    assert cloud.intensity == pytest.approx(0.2)
    assert cloud.ring is not None
    assert len(set(cloud.ring.tolist())) == 4


def test_the_truth_is_the_lidars_in_our_axes(root: Path) -> None:
    truth = open_dataset(root, "61").ground_truth
    assert truth is not None
    assert np.allclose(truth[:, :3, 3], [[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    assert np.allclose(truth[:, :3, :3], np.eye(3))


def test_the_front_camera_sees_what_is_ahead(root: Path) -> None:
    data = open_dataset(root, "61")
    assert data.calibration is not None
    assert data.calibration.K[0, 0] == 1266
    assert np.allclose(data.calibration.T_camera_lidar @ [10, 2, 1, 1], [-2, -1.5, 9.5, 1])
    shades = [None if image is None else int(image[0, 0, 0]) for image in (data[at].image for at in range(3))]
    assert shades == [100, 101, None]
    assert [problem.kind for problem in data[2].problems] == ["missing image"]


def test_tables_that_are_damaged_are_named(root: Path) -> None:
    (root / "v1.0-mini" / "ego_pose.json").write_text("[{")
    with pytest.raises(InputError, match=r"ego_pose\.json: damaged .*; unpack nuScenes's metadata afresh"):
        open_dataset(root, "61")


@pytest.mark.parametrize("table", ["sample_data", "calibrated_sensor"])
def test_records_without_what_is_needed_are_named(root: Path, table: str) -> None:
    path = root / "v1.0-mini" / f"{table}.json"
    records = json.loads(path.read_text())
    for record in records:
        record.pop("timestamp", None)
        record.pop("translation", None)
    path.write_text(json.dumps(records))
    with pytest.raises(InputError, match=r"v1\.0-mini: .*(timestamp|translation)"):
        open_dataset(root, "61")


def test_a_scene_without_scans_is_refused(root: Path) -> None:
    (root / "v1.0-mini" / "sample.json").write_text("[]")
    with pytest.raises(InputError, match="scene-0103 has no scans of LIDAR_TOP"):
        open_dataset(root, "103")
