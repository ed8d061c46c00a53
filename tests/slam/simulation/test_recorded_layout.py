"""Simulated recordings: what the loader reads is what the folder has, and the instruments measure the true motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.recordings.mcap import Mcap
from slam.data.recordings.messages import FIX, IMU, read_message
from slam.data.recordings.recording import Recording
from slam.simulation.drivers import DRIVERS
from slam.simulation.instruments import EARTH, GRAVITY, ORIGIN, fixes_along, motion_along
from slam.simulation.simulation import Simulation, SimulationConfig

Courtyard = Any
FORMATS = ("bag", "ros2", "mcap")


def written(folder: Path, frames: int = 6, **settings: Any) -> Any:
    Simulation(SimulationConfig(drive="jam", **{"distort": True, "sensor": "vlp16", **settings})).write(folder, frames)
    return open_dataset(folder)


@pytest.mark.parametrize("form", FORMATS)
def test_a_recording_has_what_the_folder_has(courtyard: Courtyard, tmp_path: Path, form: str) -> None:
    courtyard.drive()
    folder = written(tmp_path / "folder", format="folder", driver="velodyne")
    data = written(tmp_path / "drive", format=form)
    assert data.problems == ()
    assert sorted(path.suffix for path in (tmp_path / "drive").iterdir() if path.is_dir()) == []
    np.testing.assert_array_equal(data.stamps, folder.stamps[:6])
    np.testing.assert_allclose(data.ground_truth, folder.ground_truth[:6], atol=1e-8)
    np.testing.assert_allclose(data.calibration.T_camera_lidar, folder.calibration.T_camera_lidar, atol=1e-12)
    assert (data.point_times, data.sensor.name) == (folder.point_times, "vlp16")
    for number in range(6):
        mine, theirs = data[number], folder[number]
        for name in ("xyz", "ring", "time", "intensity"):
            np.testing.assert_array_equal(getattr(mine.cloud, name), getattr(theirs.cloud, name))
        np.testing.assert_array_equal(mine.image, theirs.image)
        assert mine.problems == ()


def test_the_same_trajectory_from_every_form(
    courtyard: Courtyard, tmp_path: Path, lidarlift: Callable[..., Any]
) -> None:
    courtyard.drive()
    found = {}
    for form in ("folder", *FORMATS):
        written(tmp_path / form, format=form, driver="velodyne")
        assert lidarlift("run", tmp_path / form, "--frames", "0:6", "--out", f"run-{form}").code == 0
        names = ("trajectory_tum.txt", "odometry_tum.txt", "map.pcd")
        found[form] = [Path(f"run-{form}/{name}").read_bytes() for name in names]
    assert found["bag"] == found["ros2"] == found["mcap"] == found["folder"]


@pytest.mark.parametrize("form", ["folder", "mcap"])
@pytest.mark.parametrize(
    ("driver", "stamp"),
    [("velodyne", "end"), ("ouster", "start"), ("hesai", "start"), ("robosense", "end"), ("livox", "start")],
)
def test_drivers(courtyard: Courtyard, tmp_path: Path, form: str, driver: str, stamp: str) -> None:
    courtyard.drive(path=courtyard.path, height=1.3)
    data = written(tmp_path / "drive", 4, sensor="os1-64", format=form, driver=driver, camera=False)
    assert data.problems == ()
    assert data.point_times.stamp == stamp
    frame, own = data[2], Simulation(SimulationConfig(drive="jam", sensor="os1-64", distort=True, camera=False)).rig
    scan = own.frame(2).scan
    assert len(frame.cloud) == len(scan.xyz)
    assert set(frame.cloud.ring) == set(scan.ring)
    stamped = {"start": 0.0, "end": 0.1}[stamp]
    assert data.stamps[2] == pytest.approx(0.2 + stamped)
    instants = frame.cloud.time + 0.15 + stamped  # the drive's clock begins in the middle of the first sweep
    world = courtyard.placed(frame.cloud.xyz, courtyard.path(instants))
    assert np.median(courtyard.off_the_walls(world)) < 0.02
    assert np.percentile(courtyard.off_the_walls(world), 95) < 0.06


@pytest.mark.parametrize("driver", DRIVERS)
def test_without_distortion_points_have_no_times(courtyard: Courtyard, tmp_path: Path, driver: str) -> None:
    courtyard.drive()
    data = written(tmp_path / "drive", 4, format="bag", driver=driver, distort=False, camera=False)
    (tmp_path / "drive/sensor.yaml").unlink()
    alone: Any = open_dataset(tmp_path / "drive")
    assert data[0].cloud.time is None
    assert alone[0].cloud.time is None


def test_a_recording_is_resumed_and_grows(courtyard: Courtyard, tmp_path: Path) -> None:
    courtyard.drive()
    config = SimulationConfig(drive="jam", sensor="vlp16", format="mcap", camera=False)
    simulation = Simulation(config)
    simulation.write_frame(tmp_path / "drive", 1)
    assert simulation.missing(tmp_path / "drive", 3) == [0, 2]
    (tmp_path / "drive/simulation.json").write_text(simulation._about())
    simulation.write(tmp_path / "drive", 3)
    assert simulation.missing(tmp_path / "drive", 3) == []
    before = (tmp_path / "drive/drive.mcap").stat().st_mtime_ns
    simulation.write(tmp_path / "drive", 3)
    assert (tmp_path / "drive/drive.mcap").stat().st_mtime_ns == before
    simulation.write(tmp_path / "drive", 5)
    assert len(open_dataset(tmp_path / "drive")) == 5


def test_what_else_is_recorded(courtyard: Courtyard, tmp_path: Path) -> None:
    courtyard.drive()
    written(tmp_path / "drive", format="bag")
    topics = Recording(tmp_path, [tmp_path / "drive/drive.bag"]).topics
    counts = {name: topic.count for name, topic in topics.items()}
    assert counts == {
        **{"/velodyne_points": 6, "/camera/image_rect/compressed": 6, "/camera/camera_info": 6, "/tf_static": 1},
        **{"/ground_truth/odom": 6, "/imu/data": 100, "/gps/fix": 1},
    }
    assert topics["/imu/data"].rate == pytest.approx(200, rel=1e-3)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"format": "kitti", "driver": "hesai"}, "--driver hesai: KITTI's scans have no fields"),
        ({"format": "bag", "driver": "hesay"}, "--driver hesay; did you mean 'hesai'"),
        ({"format": "bag", "driver": "ouster", "stamp": "end"}, "--stamp end: the driver ouster stamps the start"),
        ({"format": "rosbag"}, "format 'rosbag'"),
    ],
)
def test_what_does_not_go_together(settings: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SimulationConfig(distort=True, **settings).check()  # type: ignore[arg-type]


def test_an_imu_measures_the_motion() -> None:
    """In a circle of 10 m at 5 m/s: 0.5 rad/s, and 2.5 m/s^2 towards its middle, on the left."""
    stamps = np.arange(0, 20, 0.1)
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("z", 0.5 * stamps[:, None]).as_matrix()
    poses[:, 0, 3], poses[:, 1, 3] = 10 * np.sin(0.5 * stamps), 10 - 10 * np.cos(0.5 * stamps)
    tilted = poses @ np.diag([1.0, -1, -1, 1])  # its z axis points down
    for pose, rate, force in ((poses, [0, 0, 0.5], [0, 2.5, GRAVITY]), (tilted, [0, 0, -0.5], [0, -2.5, -GRAVITY])):
        motion = motion_along(stamps, pose, np.random.default_rng(1))
        np.testing.assert_allclose(motion.rate.mean(axis=0), rate, atol=0.02)  # its bias
        np.testing.assert_allclose(motion.force.mean(axis=0), force, atol=0.3)
        assert 1e-3 < motion.rate.std() < 0.3
        np.testing.assert_allclose(np.diff(motion.stamps), 1 / 200)
        assert 5e-4 < (motion.rate - motion.rate.mean(axis=0)).std() < 1e-2


def test_fixes_are_metres_around_their_place() -> None:
    stamps = np.arange(0, 200, 0.5)
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = 3 * stamps, stamps  # east, north
    places = fixes_along(stamps, poses, np.random.default_rng(2)).places
    north = np.deg2rad(places[:, 0] - ORIGIN[0]) * EARTH
    east = np.deg2rad(places[:, 1] - ORIGIN[1]) * EARTH * np.cos(np.deg2rad(ORIGIN[0]))
    at = np.arange(len(places))
    for found, wanted in ((east, 3.0 * at), (north, 1.0 * at)):
        assert 0.8 < np.std(found - wanted) < 1.6
        assert abs(np.mean(found - wanted)) < 0.5


def test_fix_and_imu_messages(courtyard: Courtyard, tmp_path: Path) -> None:
    courtyard.drive()
    written(tmp_path / "drive", format="mcap", camera=False)
    file = Mcap(tmp_path / "drive/drive.mcap", (IMU, FIX))
    for kind in (IMU, FIX):
        number = next(number for number, channel in file.channels.items() if channel.type == kind)
        _, block, offset = file.series[number].rows[0].tolist()
        message = read_message(file.read(block, offset), kind, "cdr")
        if kind == IMU:
            assert message.linear_acceleration.z == pytest.approx(GRAVITY, abs=2)
            assert message.orientation_covariance[0] == -1
        else:
            assert message.latitude == pytest.approx(49.011, abs=1e-3)
