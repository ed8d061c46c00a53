"""`lidarlift export`: trajectories and maps in other formats and frames."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from slam.data.cloud import PointCloud
from slam.data.point_files import read_cloud, read_points
from slam.data.point_writer import write_points
from slam.data.pose_files import read_poses

Command = Callable[..., Any]


@pytest.mark.usefixtures("finished")
@pytest.mark.parametrize("kind", ["kitti", "tum"])
def test_trajectories_are_exported(lidarlift: Command, kind: str) -> None:
    assert lidarlift("export", "r", "new/out.txt", "--format", kind).code == 0
    stamps, poses = read_poses(Path("new/out.txt"))
    assert poses == pytest.approx(read_poses(Path("r/trajectory_tum.txt"))[1], abs=1e-8)
    assert (stamps is None) == (kind == "kitti")


@pytest.mark.usefixtures("finished")
def test_maps_are_exported(lidarlift: Command) -> None:
    """Format by the suffix; forward is z of camera 0, and x of the LiDAR."""
    assert lidarlift("export", "r", "map.ply").code == 0
    assert lidarlift("export", "r", "camera.pcd", "--frame", "camera").code == 0
    own, ply, camera = (read_points(Path(name)) for name in ("r/map.pcd", "map.ply", "camera.pcd"))
    np.testing.assert_array_equal(ply.xyz, own.xyz)
    np.testing.assert_array_equal(ply.intensity, own.intensity)
    x, y, z = own.xyz.T
    assert camera.xyz == pytest.approx(np.column_stack([-y + 0.1, -z + 0.2, x + 0.3]), abs=1e-4)


@pytest.mark.usefixtures("finished")
def test_an_exported_map_keeps_its_colours(lidarlift: Command) -> None:
    own = read_points(Path("r/map.pcd"))
    colour = (np.arange(3 * len(own.xyz)) % 251).astype(np.uint8).reshape(-1, 3)
    write_points(Path("r/map.pcd"), PointCloud(own.xyz, own.xyz[:, 0] * 0, colour=colour))
    assert lidarlift("export", "r", "map.ply").code == 0
    np.testing.assert_array_equal(read_points(Path("map.ply")).colour, colour)


@pytest.mark.usefixtures("finished")
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_maps_are_exported_as_las(lidarlift: Command, suffix: str) -> None:
    assert lidarlift("export", "r", f"map{suffix}").code == 0
    own, las = read_points(Path("r/map.pcd")), read_points(Path(f"map{suffix}"))
    np.testing.assert_allclose(las.xyz, own.xyz, atol=6e-4)  # LAS coordinates are in steps of 1 mm
    assert own.intensity is not None
    assert las.intensity is not None
    np.testing.assert_allclose(las.intensity / 65535, own.intensity, atol=1e-5)


@pytest.mark.usefixtures("finished")
@pytest.mark.parametrize("suffix", [".ply", ".las"])
def test_a_map_of_any_size_is_exported_completely(lidarlift: Command, suffix: str) -> None:
    """The limit of 10 km, beyond which points of a scan are damage, does not apply to a map."""
    xyz = np.column_stack([np.linspace(0, 50_000, 1000), np.zeros(1000), np.ones(1000)])
    write_points(Path("r/map.pcd"), PointCloud(xyz, np.ones(1000)))
    assert lidarlift("export", "r", f"map{suffix}").code == 0
    exported = read_cloud(Path(f"map{suffix}"))
    np.testing.assert_allclose(exported.xyz, xyz, atol=4e-3)
    assert exported.problems == ()


@pytest.mark.usefixtures("finished")
def test_a_damaged_map_is_an_error_of_one_line(lidarlift: Command) -> None:
    Path("r/map.pcd").write_bytes(b"nothing of the kind")
    lidarlift("export", "r", "map.ply").refused("not a .pcd file")
    assert not Path("map.ply").exists()


@pytest.mark.usefixtures("finished")
def test_a_run_is_exported_for_viewers(lidarlift: Command) -> None:
    """rosbags reads the path, the map, and the pose of the LiDAR at each stamp."""
    assert lidarlift("export", "r", "run.mcap").code == 0
    stamps, poses = read_poses(Path("r/trajectory_tum.txt"))
    assert stamps is not None
    types, found = get_typestore(Stores.ROS2_HUMBLE), dict[str, list[Any]]()
    with Reader("run.mcap") as reader:
        for connection, time, data in reader.messages():
            found.setdefault(connection.topic, []).append((time, types.deserialize_cdr(data, connection.msgtype)))
    assert {topic: len(messages) for topic, messages in found.items()} == {
        **{"/lidarlift/map": 1, "/lidarlift/path": 1, "/lidarlift/odometry": len(poses), "/tf": len(poses)},
    }
    time, last = found["/lidarlift/odometry"][-1]
    place = last.pose.pose.position
    assert time / 1e9 == pytest.approx(stamps[-1], abs=1e-6)
    assert (last.header.frame_id, last.child_frame_id) == ("map", "lidar")
    np.testing.assert_allclose([place.x, place.y, place.z], poses[-1][:3, 3], atol=1e-8)
    assert len(found["/lidarlift/path"][0][1].poses) == len(poses)
    cloud, own = found["/lidarlift/map"][0][1], read_points(Path("r/map.pcd"))
    assert [field.name for field in cloud.fields][:4] == ["x", "y", "z", "intensity"]
    table = np.frombuffer(cloud.data.tobytes(), np.float32).reshape(-1, cloud.point_step // 4)
    np.testing.assert_array_equal(table[:, :3], own.xyz)


@pytest.mark.usefixtures("finished")
def test_an_unknown_suffix_is_an_error(lidarlift: Command) -> None:
    lidarlift("export", "r", "out.txt").refused("--format kitti, tum, pcd, ply, las, laz or mcap")


@pytest.mark.parametrize(
    "arguments", [("o.txt", "--format", "kitti"), ("o.ply",), ("o.txt", "--format", "tum", "--frame", "camera")]
)
def test_a_folder_without_a_run_is_an_error(lidarlift: Command, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    (tmp_path / "empty").mkdir()
    lidarlift("export", "empty", *arguments).refused("empty")
    assert not Path(arguments[0]).exists()


@pytest.mark.parametrize("content", ["{}", "3"])
def test_a_run_json_of_another_program_is_an_error(lidarlift: Command, tmp_path: Path, content: str) -> None:
    (tmp_path / "trajectory_tum.txt").write_text("0 0 0 0 0 0 0 1\n")
    (tmp_path / "run.json").write_text(content)
    lidarlift("export", tmp_path, "o.txt", "--format", "kitti", "--frame", "camera").refused("run.json")


@pytest.fixture
def killed(finished: Path) -> Path:
    """The folder of a run that was killed before it wrote its results."""
    Path("r/session").rename("r/unfinished")
    Path("r/run.json").unlink()
    return finished


@pytest.mark.usefixtures("killed")
def test_a_run_that_was_killed_is_exported(lidarlift: Command) -> None:
    for name, options in {"kitti.txt": ("--format", "kitti"), "map.ply": (), "both.mcap": ()}.items():
        result = lidarlift("export", "r", name, *options)
        assert result.code == 0, result.err
        assert "the run did not finish; its first 8 frames are exported" in result.err
    assert read_poses(Path("kitti.txt"))[1] == pytest.approx(read_poses(Path("r/trajectory_tum.txt"))[1], abs=1e-8)
    whole, found = read_points(Path("r/map.pcd")), read_points(Path("map.ply"))
    np.testing.assert_array_equal(found.xyz, whole.xyz)
    assert lidarlift("export", "r", "camera.txt", "--format", "kitti", "--frame", "camera").code == 0
    assert read_poses(Path("camera.txt"))[1][-1, 2, 3] == pytest.approx(9.8, abs=0.2)  # forward is z


HOSTILE = {
    "settings": "UPDATE about SET value = '{\"odometry\": {\"voxel_size\": -1}}' WHERE name = 'settings'",
    "no settings": "DELETE FROM about WHERE name = 'settings'",
    "deep JSON": f"UPDATE about SET value = '{'[' * 100_000}' WHERE name = 'input'",
    "no frames": "DELETE FROM frame",
    "a frame changed": "UPDATE frame SET pose = '[]' WHERE number = 3",
    "more edges": "INSERT INTO edge SELECT number + 100, i, j, pose, covariance, crc FROM edge",
    "a keyframe beyond the frames": "UPDATE keyframe SET position = 1000 WHERE number = 2",
    "a cloud that is too short": "UPDATE keyframe SET cloud = x'ffffff7f0000000000000000'",
}


@pytest.mark.usefixtures("killed")
@pytest.mark.parametrize("kind", HOSTILE)
def test_a_session_that_lies_is_refused_and_nothing_is_written(lidarlift: Command, kind: str) -> None:
    database = sqlite3.connect("r/unfinished/session.sqlite")
    database.execute(HOSTILE[kind])
    database.commit()
    database.close()
    lidarlift("export", "r", "map.ply").refused("r/unfinished/session.sqlite")
    assert not Path("map.ply").exists()


def test_a_folder_without_a_session_is_no_run(lidarlift: Command) -> None:
    Path("r").mkdir()
    lidarlift("export", "r", "map.ply").refused("r/run.json: not a run")
