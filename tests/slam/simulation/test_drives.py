from pathlib import Path

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import kitti_text, tum_text
from slam.simulation.drive_names import DRIVES
from slam.simulation.drives import Drive, at_rate, built_in, from_file, thinned

CAMERA = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])  # T_camera_lidar


def curve(count: int = 40, step: float = 1.0) -> Array:
    """LiDAR poses of a car that turns left and climbs a little."""
    motion = se3.exp(np.array([0, -0.002, 0.02, step, 0, 0]))
    poses = [np.eye(4)]
    for _ in range(count - 1):
        poses.append(poses[-1] @ motion)
    return np.array(poses)


@pytest.mark.parametrize("name", [name for name in DRIVES.names() if built_in(name).scene == "town"])
def test_a_built_in_drive_is_driven_as_a_car_drives(name: str) -> None:
    drive = built_in(name)
    speed = np.diff(drive.way) / np.diff(drive.stamps)
    assert speed.max() < (30.1 if name == "motorway" else 15)
    assert np.abs(np.diff(speed) / 0.1).max() < 4.0
    turn = np.diff(drive.yaw) / np.diff(drive.stamps)
    assert np.abs(speed * turn).max() < 4.0, "no more sideways than tyres hold"
    steps = np.diff(drive.position[:, :2], axis=0)
    moving = speed > 1.0
    heading = np.column_stack([np.cos(drive.yaw[:-1]), np.sin(drive.yaw[:-1])])[moving]
    assert (np.einsum("ij,ij->i", heading, steps[moving]) > 0.99 * np.linalg.norm(steps[moving], axis=1)).all()


def test_a_thinned_drive_is_the_same_drive_in_fewer_frames() -> None:
    drive = built_in("loop")
    other = thinned(drive, 2)
    assert len(other) == -(-len(drive) // 2)
    assert other.stamps[:3] == pytest.approx([0, 0.2, 0.4])
    np.testing.assert_array_equal(other.position[5], drive.position[10])
    assert other.yaw[-1] == drive.yaw[::2][-1]
    assert np.diff(other.way).mean() == pytest.approx(1.5, abs=0.1)


def test_the_loop_revisits_streets_in_both_directions() -> None:
    drive = built_in("loop")
    assert 450 < drive.way[-1] < 550
    apart = np.linalg.norm(drive.position[:, None, :2] - drive.position[None, :, :2], axis=2)
    later = drive.way[:, None] - drive.way[None] > 100
    turned = np.cos(drive.yaw[:, None] - drive.yaw[None])
    assert ((apart < 1) & later & (turned > 0.99)).any(axis=1).sum() > 30, "the same lane"
    assert ((apart < 4) & later & (turned < -0.99)).any(axis=1).sum() > 20, "the other lane, the other way"


def test_the_jam_crawls_and_stands() -> None:
    drive = built_in("jam")
    speed = np.diff(drive.way) / np.diff(drive.stamps)
    assert speed.max() < 5
    assert (speed < 0.05).sum() >= 10


def test_crawling_traffic_moves_by_centimetres_and_stops_again_and_again() -> None:
    drive = built_in("crawl")
    steps = np.diff(drive.way)
    assert 250 <= len(drive) <= 350
    assert steps.max() <= 0.2
    assert np.mean(steps > 0.02) > 0.5
    stops = np.diff(np.concatenate([[0], (steps == 0).astype(int)])) == 1
    assert stops.sum() >= 3


@pytest.mark.parametrize("name", ["loop", "straight", "tunnel", "motorway", "bridge", "traffic"])
def test_spacing_sets_the_distance_between_frames(name: str) -> None:
    drive = built_in(name, spacing=1.5)
    np.testing.assert_allclose(np.diff(drive.way), 1.5, atol=0.05)
    np.testing.assert_allclose(np.diff(drive.stamps), 0.1)
    other = built_in(name)
    assert (drive.scene, drive.tunnel, drive.period) == (other.scene, other.tunnel, other.period)


@pytest.mark.parametrize("axes", ["lidar", "camera"])
def test_a_file_may_hold_poses_of_a_camera_or_of_a_lidar(axes: str, tmp_path: Path) -> None:
    poses = curve()
    written = poses if axes == "lidar" else CAMERA @ poses @ se3.inverse(CAMERA)
    (tmp_path / "poses.txt").write_text(kitti_text(written))
    drive = from_file(tmp_path / "poses.txt")
    np.testing.assert_allclose(drive.position, poses[:, :3, 3], atol=1e-6)
    np.testing.assert_allclose(drive.yaw, np.arctan2(poses[:, 1, 0], poses[:, 0, 0]), atol=1e-6)
    np.testing.assert_allclose(drive.stamps, 0.1 * np.arange(40))


def test_the_stamps_of_a_tum_file_are_kept(tmp_path: Path) -> None:
    stamps = 100 + 0.2 * np.arange(40)
    (tmp_path / "poses.txt").write_text(tum_text(stamps, curve()))
    np.testing.assert_allclose(from_file(tmp_path / "poses.txt").stamps, stamps - 100)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda poses: poses[:1], "has one pose"),
        (lambda poses: np.concatenate([poses[:7], poses[7:] + jump()]), "lines 7 and 8 are 3"),
        (lambda poses: np.repeat(poses[:1], 9, axis=0), "move 0.00 m"),
    ],
)
def test_unusable_trajectories_are_an_error(change: object, message: str, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text(kitti_text(change(curve())))  # type: ignore[operator]
    with pytest.raises(InputError, match=message) as error:
        from_file(tmp_path / "poses.txt")
    assert "poses.txt" in str(error.value)


def test_non_increasing_stamps_are_an_error(tmp_path: Path) -> None:
    stamps = 0.1 * np.arange(40)
    stamps[11] = stamps[10]
    (tmp_path / "poses.txt").write_text(tum_text(stamps, curve()))
    with pytest.raises(InputError, match="the stamp of line 12 is not later"):
        from_file(tmp_path / "poses.txt")


def jump() -> Array:
    shift = np.zeros((4, 4))
    shift[1, 3] = 30.0
    return shift


@pytest.mark.parametrize("spacing", [0.0, -1.0, 11.0, float("nan"), float("inf")])
def test_a_too_large_spacing_is_an_error(spacing: float) -> None:
    with pytest.raises(InputError, match=r"a spacing of .* m: frames can be up to 10 m apart"):
        built_in("loop", spacing)


def test_another_rate_keeps_the_path() -> None:
    slow = built_in("jam")
    fast = at_rate(slow, 20.0)
    assert len(fast) == 2 * len(slow) - 1
    assert fast.rate == 20
    np.testing.assert_allclose(fast.stamps[::2], slow.stamps, atol=1e-9)
    np.testing.assert_allclose(fast.position[::2], slow.position, atol=1e-6)
    np.testing.assert_allclose(fast.yaw[::2], slow.yaw, atol=1e-6)
    steps = np.diff(fast.way)
    assert steps[1:].max() < 0.3
    assert np.abs(np.diff(steps)).max() < 0.02  # m: no jerks between the frames
    assert len(at_rate(slow, 5.0)) == len(slow) // 2


def test_another_rate_samples_the_path() -> None:
    def circle(stamps: np.ndarray) -> np.ndarray:
        poses = np.tile(np.eye(4), (len(stamps), 1, 1))
        cosine, sine = np.cos(stamps), np.sin(stamps)
        poses[:, :2, :2] = np.moveaxis(np.array([[cosine, -sine], [sine, cosine]]), -1, 0)
        poses[:, 0, 3], poses[:, 1, 3] = 9 * sine, -9 * cosine
        return poses

    stamps = np.arange(0, 6.5, 0.5)  # so few that what is between them shows
    drive = Drive("circle", stamps, circle(stamps)[:, :3, 3], stamps.copy(), path=circle)
    fast = at_rate(drive, 10.0)
    np.testing.assert_allclose(np.linalg.norm(fast.position[:, :2], axis=1), 9.0)
    np.testing.assert_allclose(fast.yaw, fast.stamps, atol=1e-9)
