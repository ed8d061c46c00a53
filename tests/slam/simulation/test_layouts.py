"""Folders of stamped points: what the loader reads, and that points, times, stamps and poses agree."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from slam.data.camera import project
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.data.point_files import read_points
from slam.data.pose_files import read_poses
from slam.simulation.simulation import Simulation, SimulationConfig

INSTANT = {"start": 0.0, "middle": 0.05, "end": 0.1}
Courtyard = Any


def written(folder: Path, **settings: Any) -> Dataset:
    config = SimulationConfig(drive="jam", format="folder", **settings)
    Simulation(config).write(folder, 4)
    return open_dataset(folder)


def in_the_world(courtyard: Courtyard, folder: Path, number: int) -> Any:
    """The points of a scan, each placed by where the sensor truly was at its time."""
    points = read_points(folder / f"scans/{number:06d}.pcd")
    clock = np.loadtxt(folder / "times.txt")[number] - 0.05  # the drive's own begins in the middle of the first sweep
    return courtyard.placed(points.xyz, courtyard.path(clock + points.times["time"]))


def test_the_world_does_not_depend_on_the_stamp(courtyard: Courtyard, tmp_path: Path) -> None:
    courtyard.drive(path=courtyard.path, height=1.3)
    worlds = []
    for stamp, instant in INSTANT.items():
        folder = tmp_path / stamp
        data = written(folder, sensor="os1-64", distort=True, camera=False, stamp=stamp)
        np.testing.assert_allclose(data.stamps[:4], 0.1 * np.arange(4) + instant, atol=1e-9)
        _, poses = read_poses(folder / "poses.txt")
        np.testing.assert_allclose(poses, courtyard.path(0.1 * np.arange(6) + instant - 0.05), atol=1e-3)
        worlds.append(in_the_world(courtyard, folder, 2))
        off = courtyard.off_the_walls(worlds[-1])
        assert np.median(off) < 0.02
        assert np.percentile(off, 95) < 0.06
    np.testing.assert_allclose(worlds[0], worlds[1], atol=1e-4)
    np.testing.assert_allclose(worlds[0], worlds[2], atol=1e-4)


def test_points_are_seen_from_where_a_car_is_at_their_times(courtyard: Courtyard) -> None:
    courtyard.drive()
    rig = Simulation(SimulationConfig(drive="jam", sensor="vlp32c", distort=True, camera=False, tilt=0.1)).rig
    scan, sweep = rig.frame(2).scan, rig.sweep(2)
    some = slice(None, None, 50)
    poses = np.array([sweep.at(fraction) for fraction in scan.fraction[some]])
    off = courtyard.off_the_walls(courtyard.placed(scan.xyz[some], poses))
    assert np.median(off) < 0.02
    assert np.percentile(off, 95) < 0.06
    still = courtyard.off_the_walls(courtyard.placed(scan.xyz[some], rig.poses[[2] * len(poses)]))
    assert np.percentile(still, 95) > 0.15  # and they were bent before


def test_along_a_path_each_sweep_begins_where_the_one_before_ends(courtyard: Courtyard) -> None:
    courtyard.drive(path=courtyard.path, height=1.3)
    rig = Simulation(SimulationConfig(drive="jam", distort=True, camera=False, height=1.9, tilt=0.2)).rig
    for number in range(4):
        np.testing.assert_allclose(rig.sweep(number).at(1.0), rig.sweep(number + 1).at(0.0), atol=1e-9)
        np.testing.assert_allclose(rig.sweep(number).at(0.5), rig.poses[number], atol=1e-9)
    lifted = rig.poses[3][:3, 3] - courtyard.path(np.array([0.3]))[0, :3, 3]
    np.testing.assert_allclose(lifted, [0, 0, 0.6], atol=1e-9)


@pytest.mark.parametrize("stamp", INSTANT)
def test_times_rise_and_stay_within_the_sweep(courtyard: Courtyard, tmp_path: Path, stamp: str) -> None:
    courtyard.drive()
    written(tmp_path / "walk", sensor="vlp16", rate=20, distort=True, camera=False, stamp=stamp)
    times = read_points(tmp_path / "walk/scans/000001.pcd").times["time"]
    assert times.dtype == np.float32
    assert (np.diff(times) >= 0).all()
    assert times[0] == pytest.approx(-INSTANT[stamp] / 2, abs=1e-4)
    assert times[-1] == pytest.approx(0.05 - INSTANT[stamp] / 2, abs=1e-4)


@pytest.mark.parametrize("name", ["hdl64", "vlp16", "hdl32", "vlp32c", "vls128", "os1-64", "os1-128"])
def test_the_loader_reads_each_lidar(courtyard: Courtyard, tmp_path: Path, name: str) -> None:
    courtyard.drive()
    data = written(tmp_path / "walk", sensor=name, distort=True, camera=False)
    assert data.sensor is not None
    assert (data.sensor.name, data.sensor.motion_compensated) == (name, False)
    assert data.problems == ()
    cloud = data[1].cloud
    assert cloud.ring is not None
    assert cloud.time is not None
    assert set(cloud.ring) == set(range(data.sensor.ring_count))
    assert (np.diff(cloud.time) >= 0).all()
    line = np.tan(data.sensor.elevation)[cloud.ring] * np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1])
    assert np.abs(cloud.xyz[:, 2] - line - data.sensor.offset[cloud.ring]).max() < 0.01
    ahead = np.abs(cloud.xyz[:, 1]) < 0.05 * cloud.xyz[:, 0]
    assert np.abs(cloud.time[ahead]).max() < 0.003  # lasers that look aside are early or late
    assert 0 < cloud.intensity.mean() < 1


def test_the_camera_stays_level_and_sees_what_a_tilted_lidar_sees(courtyard: Courtyard, tmp_path: Path) -> None:
    courtyard.drive()
    tilted = written(tmp_path / "tilted", sensor="os1-64", tilt=0.2, depth=True)
    level = written(tmp_path / "level", sensor="os1-64")
    names = [f"{folder}/images/000001.png" for folder in ("tilted", "level")]
    assert (tmp_path / names[0]).read_bytes() == (tmp_path / names[1]).read_bytes()
    frame = tilted[1]
    assert frame.image is not None
    assert frame.calibration is not None
    depth = cv2.imread(str(tmp_path / "tilted/depth/000001.png"), cv2.IMREAD_UNCHANGED) / 256
    pixels, far = project(frame.cloud.xyz, frame.calibration)
    u, v = np.nan_to_num(np.round(pixels), nan=-1).astype(int).T
    inside = (u >= 0) & (u < depth.shape[1]) & (v >= 0) & (v < depth.shape[0])
    assert inside.sum() > 1000
    assert np.percentile(np.abs(depth[v[inside], u[inside]] - far[inside]), 95) < 0.1
    truth = tilted.ground_truth, level.ground_truth
    assert truth[0] is not None
    assert truth[1] is not None
    gone = [np.linalg.norm(poses[:, :3, 3], axis=1) for poses in truth]
    np.testing.assert_allclose(gone[0], gone[1], atol=1e-9)


@pytest.mark.parametrize(("height", "tilt"), [(1.73, 0.0), (0.8, 0.0), (2.5, 0.15), (2.5, -0.15)])
def test_mounting_of_the_lidar_is_applied(courtyard: Courtyard, height: float, tilt: float) -> None:
    courtyard.drive()
    rig = Simulation(SimulationConfig(drive="jam", sensor="os1-64", height=height, tilt=tilt, camera=False)).rig
    xyz = rig.frame(0).scan.xyz.astype(float)
    level = xyz @ np.array([[np.cos(tilt), 0, -np.sin(tilt)], [0, 1, 0], [np.sin(tilt), 0, np.cos(tilt)]])
    below = level[(level[:, 2] < -0.5 * height) & (np.hypot(level[:, 0], level[:, 1]) < 5)]
    assert np.median(below[:, 2]) == pytest.approx(-height, abs=0.02)
    assert below[:, 2].std() < 0.03
    assert rig.poses[0][2, 3] == pytest.approx(height)


def test_a_drive_has_a_default_height(courtyard: Courtyard) -> None:
    courtyard.drive(height=1.3)
    assert Simulation(SimulationConfig(drive="jam")).rig.poses[0][2, 3] == pytest.approx(1.3)
    assert Simulation(SimulationConfig(drive="jam", height=2.0)).rig.poses[0][2, 3] == pytest.approx(2.0)


def test_away_from_kittis_car_nothing_of_it_is_in_the_way(courtyard: Courtyard) -> None:
    courtyard.drive()
    rows = {}
    for height in (None, 2.0):
        rig = Simulation(SimulationConfig(drive="jam", height=height, camera=False)).rig
        rows[height] = np.bincount(rig.frame(0).scan.ring)
    assert rows[None][63] < 1400
    assert rows[2.0][63] > 1900


def test_a_folder_is_resumed(courtyard: Courtyard, tmp_path: Path) -> None:
    courtyard.drive()
    config = SimulationConfig(drive="jam", sensor="vlp16", format="folder", camera=False)
    Simulation(config).write(tmp_path / "walk", 3)
    (tmp_path / "walk/scans/000001.pcd").unlink()
    assert Simulation(config).missing(tmp_path / "walk", 3) == [1]
    Simulation(config).write(tmp_path / "walk", 3)
    assert Simulation(config).missing(tmp_path / "walk", 3) == []
    assert not Simulation(SimulationConfig(drive="jam", sensor="vlp16", camera=False)).matches(tmp_path / "walk")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"stamp": "start", "distort": True}, "--stamp start: KITTI's stamps are at mid-sweep; add --format folder"),
        ({"stamp": "end", "format": "folder"}, "--stamp end: the LiDAR does not move during a sweep"),
        ({"stamp": "never", "format": "folder"}, "stamp 'never'"),
        ({"rate": 20.0, "spacing": 1.0}, "--rate 20: conflicts with --spacing"),
        ({"sensor": "vlp32"}, "unknown sensor 'vlp32'; did you mean 'vlp32c'?"),
        ({"rate": 0.0}, "--rate 0"),
        ({"height": -1.0}, "--height -1"),
        ({"tilt": 2.0}, "--tilt 114.592"),
    ],
)
def test_conflicting_settings_are_an_error(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        Simulation(SimulationConfig(drive="jam", **settings))  # type: ignore[arg-type]
    assert message in str(error.value)
    assert "\n" not in str(error.value)
