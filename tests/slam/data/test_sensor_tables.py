"""Every built-in LiDAR: its table, and its rings found in simulated scans."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.folder import UserFolder
from slam.data.point_files import Points
from slam.data.scan_columns import find_columns
from slam.data.scan_rings import usual_rings
from slam.data.sensor import Sensor, load_sensor
from slam.data.sensor_names import SENSORS

NAMES = SENSORS.names()
NUMBERS = (
    *("from the top", "from the bottom", "from one", "none"),
    *("firing order", "halves in turn", "every second first"),  # numbers of lasers
)


def scan_of(sensor: Sensor, columns: int = 120) -> tuple[Array, Array]:
    """Points (N, 3) between 3 and 50 m, column by column, with 2 cm of noise along the ray and coordinates of whole
    millimetres; and the ring of each."""
    rng = np.random.default_rng(4)
    ring = np.tile(np.arange(sensor.ring_count), columns)
    azimuth = np.repeat(np.arange(columns) * 2 * np.pi / columns, sensor.ring_count) + sensor.azimuth[ring]
    reach = rng.uniform(3, 50, len(ring)) + rng.normal(0, 0.02, len(ring))
    rho, z = reach * np.cos(sensor.elevation[ring]), reach * np.sin(sensor.elevation[ring]) + sensor.offset[ring]
    return np.column_stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z]).round(3).astype(np.float32), ring


@pytest.mark.parametrize("name", NAMES)
def test_lines_fall_from_the_top(name: str) -> None:
    sensor = load_sensor(name)
    assert (sensor.name, sensor.ring_count) == (name, len(sensor.azimuth))
    assert (np.diff(sensor.elevation) < 0).all()
    assert np.abs(np.rad2deg(sensor.azimuth)).max() < 10
    assert np.abs(sensor.offset).max() < 0.25


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("numbers", NUMBERS)
def test_rings_are_recovered(name: str, numbers: str) -> None:
    sensor = load_sensor(name)
    xyz, ring = scan_of(sensor)
    count = sensor.ring_count
    fired = np.random.default_rng(1).permutation(count)
    told = {
        "from the top": ring,
        "from the bottom": count - 1 - ring,
        "from one": ring + 1,
        "firing order": fired[ring],
        "halves in turn": np.argsort(np.r_[0:count:2, 1:count:2])[ring],  # as a VLP-16's lasers
        "every second first": np.r_[0:count:2, 1:count:2][ring],
        "none": None,
    }[numbers]
    points = Points(xyz, ring=told)
    cloud, problems = find_columns([(points, None)], sensor).cloud(points, 0.0, Path("scan"))
    assert problems == ()
    assert cloud.ring is not None
    assert np.mean(cloud.ring == ring) >= 0.99


def lines_problems(points: Points, sensor: Sensor) -> list[str]:
    problems = find_columns([(points, None)], sensor).problems
    return [problem.message for problem in problems if problem.kind == "laser lines"]


@pytest.mark.parametrize("named", [True, False])
def test_points_off_the_laser_lines_are_reported(named: bool) -> None:
    """VLP-16 and Puck Hi-Res have 16 rings; their lines differ by up to 5 deg."""
    xyz, ring = scan_of(load_sensor("vlp16"))
    points = Points(xyz, ring=ring if named else None)
    assert lines_problems(points, load_sensor("vlp16")) == []
    (text,) = lines_problems(points, load_sensor("puck-hires"))
    assert "of the points lie farther from the laser lines of puck-hires than" in text
    assert "fit-lasers" in text


def test_compensated_scans_may_be_off_the_lines() -> None:
    xyz, ring = scan_of(load_sensor("vlp16"))
    columns = find_columns([(Points(xyz, ring=ring), None)], load_sensor("puck-hires"), compensated=True)
    assert columns.problems == ()


def test_the_number_of_rings_is_that_of_most_scans() -> None:
    """The uppermost rings see only sky in the first two scans, and a damaged scan does not count."""
    xyz, ring = scan_of(Sensor("s", np.linspace(0.3, -0.4, 32), np.zeros(32)))
    low, complete = Points(xyz[ring > 20], ring=31 - ring[ring > 20]), Points(xyz, ring=31 - ring)
    scans = [low, low, complete, complete, Points(xyz, ring=ring + 90)]
    assert find_columns([(points, None) for points in scans]).rings == 32


@pytest.mark.parametrize("count", [16, 32, 40, 64, 128])
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("upwards", [False, True])
def test_rings_are_counted_where_nobody_names_the_sensor(count: int, first: int, upwards: bool) -> None:
    sensor = Sensor("s", np.linspace(0.3, -0.4, count), np.zeros(count))
    xyz, ring = scan_of(sensor)
    points = Points(xyz, ring=(count - 1 - ring if upwards else ring) + first)
    columns = find_columns([(points, None)])
    cloud, problems = columns.cloud(points, 0.0, Path("scan"))
    assert (columns.rings, problems) == (count, ())
    assert cloud.ring is not None
    assert np.array_equal(cloud.ring, ring)


@pytest.mark.parametrize(
    ("highest", "count"), [(0, 16), (15, 16), (16, 32), (35, 40), (50, 64), (127, 128), (130, 256)]
)
def test_as_many_rings_as_there_are_lidars_with(highest: int, count: int) -> None:
    assert usual_rings(highest) == count


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("HDL-32E", "hdl32"),
        ("Velodyne VLP-16", "vlp16"),
        ("Puck Hi-Res", "puck-hires"),
        ("Ouster OS-1-64", "os1-64"),
        ("PandarXT-32", "xt32"),
        ("Hesai Pandar40P", "pandar40p"),
        ("RoboSense RS-Helios", "rs-helios"),
        ("Bpearl", "rs-bpearl"),
    ],
)
def test_makers_spellings(said: str, name: str) -> None:
    assert load_sensor(said).name == name


def test_values_from_the_makers_tables() -> None:
    """[deg], the first and the last beams, and a beam's azimuth to the left."""

    def ends(name: str) -> list[float]:
        return [float(value) for value in np.rad2deg(load_sensor(name).elevation[[0, -1]]).round(2)]

    assert ends("hdl32") == [10.67, -30.67]
    assert ends("puck-hires") == [10.0, -10.0]
    assert ends("pandar40p") == [15.0, -25.0]
    assert ends("xt32") == [15.0, -16.0]
    assert ends("qt64") == [52.13, -52.12]
    assert ends("os0-128") == [45.0, -45.0]
    assert ends("os2-64") == [11.25, -11.25]
    assert ends("rs-bpearl") == [89.5, 2.31]
    assert np.rad2deg(load_sensor("pandar40p").azimuth[:8]).round(3).tolist() == [1.042] * 6 + [-3.125, 5.208]


def test_nominal_lines_are_said_once(tmp_path: Path) -> None:
    table = np.ones((50, 4), np.float32)
    for number in range(2):
        np.save(tmp_path / f"{number}.npy", table)
    for name, remedy in (("os1-64", "FILE.json"), ("xt32", "fit-lasers"), ("vlp16", None)):
        data = UserFolder(tmp_path, name)
        told = [problem.message for problem in data.problems if problem.kind == "nominal laser lines"]
        assert len(told) == (remedy is not None)
        assert all(remedy in text for text in told if remedy)


def test_an_ousters_metadata_name_a_sensor(tmp_path: Path) -> None:
    path = tmp_path / "os.json"
    metadata = {
        "prod_line": "OS-1-32",
        "lidar_mode": "1024x10",
        "beam_altitude_angles": [0.0, 10.0],
        "beam_azimuth_angles": [1.5, -1.5],
    }
    path.write_text(json.dumps(metadata))
    sensor = load_sensor(path)
    assert (sensor.name, sensor.nominal) == ("OS-1-32", False)
    assert np.rad2deg(sensor.elevation) == pytest.approx([10, 0])
    assert np.rad2deg(sensor.azimuth) == pytest.approx([1.5, -1.5])
    np.save(tmp_path / "0.npy", np.ones((50, 4), np.float32))
    assert UserFolder(tmp_path, path).sensor is not None
    path.write_text("{}")
    with pytest.raises(InputError, match="metadata is needed"):
        load_sensor(path)
