from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.dataset import open_dataset

FIRST = 1326030975726043  # us
#: x y z of the files: forward, right, down [m], and the laser, which counts as it fires.
SEEN = [(10, 0, 1, 0), (10, 2, -0.5, 1), (-20, -3, 0.5, 2), (5, 5, -1, 3)]


@pytest.fixture
def day(tmp_path: Path, write_struct: Callable, write_text: Callable) -> Path:
    """Two scans, 0.2 s apart, and truth every 0.1 s: the robot drives 1 m ahead, then turns right on the spot."""
    rows = [(*(round((value + 100) / 0.005) for value in row[:3]), 51, row[3]) for row in SEEN]
    for number in range(2):
        file = tmp_path / "2012-01-08" / "velodyne_sync" / f"{FIRST + 200_000 * number}.bin"
        write_struct(file, "x:u2,y:u2,z:u2,intensity:u1,laser:u1", np.array(rows))
    turns = [0, 0, np.pi / 2]
    truth = [
        f"{FIRST - 100_000},nan,nan,nan,nan,nan,nan",
        *(f"{FIRST + 100_000 * at},{min(at, 1)},0,0,0,0,{turn}" for at, turn in enumerate(turns)),
    ]
    write_text(tmp_path / "ground_truth" / "groundtruth_2012-01-08.csv", *truth)
    return tmp_path / "2012-01-08"


def test_points_are_metres_forward_left_up(day: Path) -> None:
    data = open_dataset(day)
    cloud = data[0].cloud
    assert data.name == "NCLT 2012-01-08"
    assert np.allclose(cloud.xyz, [(x, -y, -z) for x, y, z, _ in SEEN], atol=0.003)
    assert cloud.intensity == pytest.approx(0.2)
    assert data.stamps == pytest.approx([FIRST / 1e6, FIRST / 1e6 + 0.2])
    assert cloud.time is None
    assert "motion-compensated" in data.point_times.why  # type: ignore[attr-defined]


def test_lasers_become_rings_from_the_top(day: Path) -> None:
    ring = open_dataset(day)[0].cloud.ring
    assert ring is not None
    assert ring.tolist() == [3, 1, 2, 0]


def test_the_truth_beside_the_day_is_turned_as_the_points_are(day: Path) -> None:
    data = open_dataset(day)
    assert data.ground_truth is not None
    ahead_to_the_right = np.array([[0, 1, 0, 1], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert np.allclose(data.ground_truth[1], ahead_to_the_right, atol=1e-9)
    assert data.problems == ()


def test_a_day_without_truth_is_a_drive_too(day: Path) -> None:
    (day.parent / "ground_truth" / "groundtruth_2012-01-08.csv").unlink()
    assert open_dataset(day.parent, "2012-01-08").ground_truth is None
