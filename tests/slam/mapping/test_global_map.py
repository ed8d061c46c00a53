"""The global map against averages done by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import Array, PointCloud
from slam.data.point_files import read_points
from slam.data.point_writer import write_points
from slam.mapping.global_map import GlobalMap, build_map
from slam.mapping.keyframes import Keyframe, Keyframes
from slam.settings import KeyframeSettings, MapSettings


def cloud(*points: tuple[float, float, float], intensity: Array | None = None) -> PointCloud:
    xyz = np.array(points, float).reshape(-1, 3)
    return PointCloud(xyz, np.zeros(len(xyz)) if intensity is None else intensity)


def world(voxel_size: float = 1.0, min_range: float = 0.0, max_range: float = 1e3) -> GlobalMap:
    return GlobalMap(MapSettings(voxel_size=voxel_size, min_range=min_range, max_range=max_range))


def at(x: float, y: float = 0.0, z: float = 0.0) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def test_an_empty_map_has_no_points() -> None:
    assert len(world()) == 0
    assert world().points().xyz.shape == (0, 3)


def test_a_voxel_holds_the_average_of_its_points() -> None:
    grid = world()
    grid.insert(cloud((5.1, 0.2, 0.3), (7.5, 0.5, 0.5), intensity=np.array([0.2, 0.9])), np.eye(4))
    grid.insert(cloud((5.3, 0.4, 0.9), (5.8, 0.9, 0.0), intensity=np.array([0.4, 0.6])), np.eye(4))
    points = grid.points()
    assert len(grid) == len(points) == 2
    assert points.xyz == pytest.approx(np.array([[5.4, 0.5, 0.4], [7.5, 0.5, 0.5]]), abs=1e-5)
    assert points.intensity == pytest.approx(np.array([0.4, 0.9]), abs=1e-6)


def test_negative_coordinates_have_their_own_voxels() -> None:
    """-0.1 and 0.1 are neighbours, not the same; -0.1 and -0.9 are the same."""
    grid = world()
    grid.insert(cloud((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1), (-0.9, -0.3, -0.5)), np.eye(4))
    assert grid.points().xyz == pytest.approx(np.array([[-0.5, -0.2, -0.3], [0.1, 0.1, 0.1]]), abs=1e-6)


@pytest.mark.parametrize("far", [(10_000.0, -8_000.0, 300.0), (-10_000.0, 8_000.0, -300.0)])
def test_averages_are_exact_far_from_the_origin(far: tuple[float, float, float]) -> None:
    grid = world(voxel_size=0.2)
    for _ in range(50):
        grid.insert(cloud((0.05, 0.1, 0.11), (0.15, 0.1, 0.13)), at(*far))
    assert len(grid) == 1
    assert grid.points().xyz[0] == pytest.approx(np.add(far, (0.1, 0.1, 0.12)), abs=1.1e-3)  # half a float32 step


def test_points_are_transformed_by_the_pose() -> None:
    grid, pose = world(), at(10, 20, 30)
    pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    grid.insert(cloud((3.3, 1.4, 0.5)), pose)
    assert grid.points().xyz[0] == pytest.approx([8.6, 23.3, 30.5], abs=1e-5)


def test_the_range_is_measured_from_the_sensor() -> None:
    grid = world(min_range=2.5, max_range=60.0)
    grid.insert(cloud((2.4, 0, 0), (2.6, 0, 0), (0, 0, -59), (0, 61, 0), (36, 48.1, 0)), at(500))
    assert sorted(grid.points().xyz[:, 0].tolist()) == pytest.approx([500, 502.6], abs=1e-3)


def test_the_same_scan_again_adds_nothing() -> None:
    """The size follows the area seen, not the number of scans; so does the memory."""
    grid = world(voxel_size=0.2)
    scan = cloud(*np.random.default_rng(0).uniform(-20, 20, (5_000, 3)))
    grid.insert(scan, np.eye(4))
    once, size = grid.points(), len(grid)
    for _ in range(100):
        grid.insert(scan, np.eye(4))
    assert len(grid) == size
    assert grid.points().xyz == pytest.approx(once.xyz, abs=1e-4)
    assert len(grid._sums) == 1 << 16


def test_the_map_grows_beyond_its_initial_capacity() -> None:
    """Against numpy's averages of 150,000 points in many batches."""
    rng, grid = np.random.default_rng(1), world(voxel_size=0.5)
    xyz = rng.uniform(-40, 40, (150_000, 3)).astype(np.float32)
    intensity = rng.random(len(xyz)).astype(np.float32)
    for part in np.array_split(np.arange(len(xyz)), 7):
        grid.insert(PointCloud(xyz[part], intensity[part]), np.eye(4))
    _, voxel = np.unique(np.floor(xyz.astype(float) / 0.5).astype(int), axis=0, return_inverse=True)
    count = np.bincount(voxel)
    assert len(grid) == len(count) > 1 << 16
    points = grid.points()
    ours = np.unique(np.floor(points.xyz.astype(float) / 0.5).astype(int), axis=0, return_index=True)[1]
    assert len(ours) == len(count)
    mean = np.column_stack([np.bincount(voxel, xyz[:, axis]) for axis in range(3)]) / count[:, None]
    assert np.abs(points.xyz[ours] - mean).max() < 1e-4
    assert np.abs(points.intensity[ours] - np.bincount(voxel, intensity) / count).max() < 1e-5


def test_returned_points_do_not_change_later() -> None:
    grid = world()
    grid.insert(cloud((5.1, 0.2, 0.3)), np.eye(4))
    before = grid.points()
    kept = before.xyz.copy()
    grid.insert(cloud((5.9, 0.2, 0.3)), np.eye(4))
    np.testing.assert_array_equal(before.xyz, kept)


# A sensor 1.7 m above a road, driven along it: every ray is cast by hand into boxes.
HEIGHT, WALL = 1.7, 8.0
Box = tuple[tuple[float, float, float], tuple[float, float, float]]
ROAD: Box = ((-500, -500, -HEIGHT - 1), (500, 500, -HEIGHT))
HOUSE: Box = ((-500, WALL, -5), (500, WALL + 1, 50))
END: Box = ((60, -500, -5), (61, 500, 50))
CAR: Box = ((16, -1, -HEIGHT), (20, 1, -0.2))
POLE: Box = ((15, 3.95, -HEIGHT), (15.1, 4.05, 2))
RINGS = {64: np.arange(-24.8, 2.1, 0.42), 16: np.arange(-15.0, 15.1, 2.0)}  # degrees


def seen_from(x: float, boxes: list[Box], channels: int) -> PointCloud:
    """A scan without noise from (x, 0, 0)."""
    azimuth = np.deg2rad(np.arange(0, 360, 0.4))
    elevation = np.deg2rad(RINGS[channels])[:, None]
    ray = np.stack(np.broadcast_arrays(np.cos(azimuth), np.sin(azimuth), np.tan(elevation)), axis=-1).reshape(-1, 3)
    reach = np.full(len(ray), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for low, high in boxes:
            to_low, to_high = (np.array(corner) - (x, 0, 0) for corner in (low, high))
            near, far = np.minimum(to_low / ray, to_high / ray), np.maximum(to_low / ray, to_high / ray)
            enter, leave = near.max(axis=1), far.min(axis=1)
            reach = np.where((enter > 0) & (enter < leave), np.minimum(reach, enter), reach)
    found = reach * np.linalg.norm(ray, axis=1) < 75
    xyz = reach[found, None] * ray[found]
    return PointCloud(xyz, np.full(len(xyz), 0.3))


def driven(worlds: list[list[Box]], channels: int, step: float = 2.0) -> list[Keyframe]:
    """A keyframe every `step` metres, each in its own world."""
    keyframes = Keyframes(KeyframeSettings(distance=step))
    for number, boxes in enumerate(worlds):
        keyframes.add(seen_from(step * number, boxes, channels), at(step * number), number, step * number)
    keyframes.finish()
    return list(keyframes)


def mapped(keyframes: list[Keyframe]) -> Array:
    return build_map(keyframes, np.array([keyframe.pose for keyframe in keyframes])).xyz


def within(xyz: Array, box: Box, margin: float = 0.05) -> Array:
    low, high = np.array(box)
    return np.asarray(((xyz > low - margin) & (xyz < high + margin)).all(axis=1))


@pytest.mark.parametrize("channels", [64, 16])
@pytest.mark.parametrize("there", [(0, 1), (8, 9)])  # first there and then gone, or first away and then there
def test_a_box_that_moved_away_is_removed(channels: int, there: tuple[int, int]) -> None:
    """All but a little near the road, which beams that graze it cannot tell from the road itself."""
    moving = [[ROAD, HOUSE, END, CAR] if number in there else [ROAD, HOUSE, END] for number in range(10)]
    keyframes = driven(moving, channels, step=1.5)
    body = (CAR[0][0], CAR[0][1], -HEIGHT + 0.5), CAR[1]
    world = GlobalMap(MapSettings())
    for keyframe in keyframes:
        world.insert(keyframe.cloud, keyframe.pose)
    before, after = within(world.points().xyz, body).sum(), within(mapped(keyframes), body).sum()
    assert before >= 30
    assert after < 0.05 * before


@pytest.mark.parametrize("channels", [64, 16])
@pytest.mark.parametrize("step", [2.0, 0.7])
def test_static_objects_are_kept(channels: int, step: float) -> None:
    """Wall, pole, parked car, and the road, grazed by beams up to 40 m away: not one voxel in a thousand is lost."""
    keyframes = driven([[ROAD, HOUSE, CAR, POLE]] * 10, channels, step)
    world = GlobalMap(MapSettings())
    for keyframe in keyframes:
        world.insert(keyframe.cloud, keyframe.pose)
    assert len(world) > 10_000
    assert 0.999 * len(world) < len(mapped(keyframes)) <= len(world)


def test_small_pose_errors_do_not_remove_the_road() -> None:
    """5 cm up and down, 0.2 degrees of pitch."""
    keyframes = driven([[ROAD, HOUSE]] * 10, 64)
    rng, poses = np.random.default_rng(0), []
    for keyframe in keyframes:
        turn = np.deg2rad(rng.uniform(-0.2, 0.2))
        wrong = np.eye(4)
        wrong[:3, :3] = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
        wrong[2, 3] = rng.uniform(-0.05, 0.05)
        poses.append(keyframe.pose @ wrong)
    world = GlobalMap(MapSettings())
    for keyframe, pose in zip(keyframes, poses, strict=True):
        world.insert(keyframe.cloud, pose)
    assert len(build_map(keyframes, np.array(poses))) > 0.99 * len(world)


def test_predicted_points_do_not_carve() -> None:
    """The box goes away, but what lies behind it is an enricher's guess."""
    worlds = [[ROAD, HOUSE, CAR]] * 2 + [[ROAD, HOUSE]] * 4
    keyframes = Keyframes()
    for number, boxes in enumerate(worlds):
        scan = seen_from(2.0 * number, boxes, 64)
        guessed = PointCloud(scan.xyz, scan.intensity, measured=np.full(len(scan), number < 2))
        keyframes.add(guessed, at(2.0 * number), number, 0.0)
    keyframes.finish()
    assert within(mapped(list(keyframes)), CAR).sum() > 50


def test_the_map_uses_the_optimised_poses() -> None:
    keyframes = driven([[HOUSE]] * 2, 16)
    aside = np.array([keyframe.pose for keyframe in keyframes])
    aside[:, 1, 3] += 100
    assert build_map(keyframes, aside).xyz[:, 1] == pytest.approx(WALL + 100, abs=0.01)


def test_the_same_keyframes_give_the_same_bytes() -> None:
    first, second = (mapped(driven([[ROAD, CAR], [ROAD], [ROAD], [ROAD]], 16)) for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_no_keyframes_make_an_empty_map() -> None:
    assert len(build_map([], np.zeros((0, 4, 4)))) == 0


def test_colours_are_averaged_where_a_camera_saw_the_voxel() -> None:
    grid = world()
    first = cloud((5.1, 0.2, 0.3), (5.2, 0.2, 0.3), (7.5, 0.5, 0.5), (9.5, 0.5, 0.5))
    colours = np.array([[10, 20, 30], [0, 0, 0], [0, 0, 0], [9, 8, 7]])
    grid.insert(cloud((5.3, 0.4, 0.9)), np.eye(4))  # before there was any colour
    grid.insert(PointCloud(first.xyz, first.intensity, colour=colours), np.eye(4))
    grid.insert(PointCloud(first.xyz[:1], first.intensity[:1], colour=np.array([[30, 20, 11]])), np.eye(4))
    colour = grid.points().colour
    assert colour is not None
    assert colour.tolist() == [[20, 20, 20], [0, 0, 0], [9, 8, 7]]


@pytest.mark.parametrize("suffix", ["pcd", "ply"])
def test_the_map_is_written_with_its_colours(tmp_path: Path, suffix: str) -> None:
    import open3d as o3d

    grid = world()
    grid.insert(PointCloud(np.array([[5.5, 0.5, 0.5]]), np.array([0.5]), colour=np.array([[1, 2, 3]])), np.eye(4))
    write_points(tmp_path / f"map.{suffix}", grid.points())
    assert read_points(tmp_path / f"map.{suffix}").xyz.tolist() == [[5.5, 0.5, 0.5]]
    assert o3d.t.io.read_point_cloud(tmp_path / f"map.{suffix}").point["colors"].numpy().tolist() == [[1, 2, 3]]
