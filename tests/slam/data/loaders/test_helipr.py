from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError

FIRST = 1689519043469735900
POINTS = {
    "Ouster": "x:f4,y:f4,z:f4,intensity:f4,t:u4,reflectivity:u2,ring:u2,ambient:u2",
    "Velodyne": "x:f4,y:f4,z:f4,intensity:f4,ring:u2,time:f4",
    "Avia": "x:f4,y:f4,z:f4,reflectivity:u1,tag:u1,line:u1,offset:u4",
    "Aeva": "x:f4,y:f4,z:f4,reflectivity:f4,velocity:f4,t:i4,line:u1,intensity:f4",
    "Aeva without intensity": "x:f4,y:f4,z:f4,reflectivity:f4,velocity:f4,t:i4,line:u1",
}
#: Of 50 points: 5 m ahead to 54 m, rings 0 to 9 and down, over 0.098 s.
COUNT = np.arange(50)
ALL = {
    "x": 5.0 + COUNT,
    "y": 0.5 + 0 * COUNT,
    "z": 1 - (COUNT % 10) / 4,
    "intensity": 51 + 0 * COUNT,
    "reflectivity": 102 + 0 * COUNT,
    "ring": COUNT % 10,
    "line": COUNT % 6,
    "t": 2_000_000 * COUNT,
    "offset": 2_000_000 * COUNT,
    "time": 0.002 * COUNT,
    "velocity": -3.0 + 0 * COUNT,
    "tag": 0 * COUNT,
    "ambient": 9 + 0 * COUNT,
}


@pytest.fixture
def town(tmp_path: Path, write_struct: Callable, write_text: Callable) -> Callable[..., Path]:
    """`town("Ouster")`: a sequence with three scans of that LiDAR, 2 m apart by the truth."""

    def make(kind: str, first: int = FIRST) -> Path:
        sensor = kind.split()[0]
        names = [word.split(":")[0] for word in POINTS[kind].split(",")]
        for number in range(3):
            file = tmp_path / "Town01" / "LiDAR" / sensor / f"{first + 100_000_000 * number}.bin"
            write_struct(file, POINTS[kind], np.column_stack([ALL[name] for name in names]))
        rows = [f"{first + 100_000_000 * number} {2 * number} 0 0 0 0 0 1" for number in range(3)]
        write_text(tmp_path / "Town01" / "LiDAR_GT" / f"{sensor}_gt.txt", *rows)
        return tmp_path / "Town01"

    return make


@pytest.mark.parametrize(
    ("kind", "first", "intensity", "rings"),
    [
        ("Ouster", FIRST, 0.2, True),
        ("Avia", FIRST, 0.4, False),
        ("Aeva", 1691936557946849180, 0.2, False),
        ("Aeva without intensity", FIRST, 0.4, False),
    ],
)
def test_each_lidar_has_a_struct_of_its_own(
    town: Callable[..., Path], kind: str, first: int, intensity: float, rings: bool
) -> None:
    data = open_dataset(town(kind, first))
    assert data.name == f"HeLiPR Town01 {kind.split()[0]}"
    cloud = data[1].cloud
    assert cloud.xyz[7].tolist() == [12, 0.5, -0.75]
    assert cloud.intensity == pytest.approx(intensity)
    assert cloud.time is not None
    assert cloud.time[[0, 49]] == pytest.approx([0, 0.098])
    assert (cloud.ring is not None) == rings
    assert data.problems == ()


def test_rings_of_the_ouster_are_those_of_its_file(town: Callable[..., Path]) -> None:
    ring = open_dataset(town("Ouster"))[0].cloud.ring
    assert ring is not None
    assert ring[:11].tolist() == [*range(10), 0]


def test_the_velodyne_is_known(town: Callable[..., Path]) -> None:
    data = open_dataset(town("Velodyne"))
    assert data.sensor is not None
    assert data.sensor.name == "vlp16"
    assert data.point_times.unit == "s"  # type: ignore[attr-defined]
    assert data.point_times.stamp == "start"  # type: ignore[attr-defined]


def test_truth_is_the_lidars_own(town: Callable[..., Path]) -> None:
    data = open_dataset(town("Ouster"))
    assert data.ground_truth is not None
    assert data.ground_truth[:, 0, 3] == pytest.approx([0, 2, 4])


def test_a_lidar_of_a_sequence_is_chosen_by_its_name(town: Callable[..., Path]) -> None:
    folder = town("Ouster")
    town("Avia")
    with pytest.raises(InputError, match="--sequence: Ouster, Avia"):
        open_dataset(folder)
    assert open_dataset(folder, "Avia").name == "HeLiPR Town01 Avia"
    assert open_dataset(folder.parent, "Town01/Avia").name == "HeLiPR Town01 Avia"
    assert open_dataset(folder / "LiDAR" / "Ouster").name == "HeLiPR Town01 Ouster"
