"""Places are recognised: turned, on another lane, in the reverse direction; others are not offered."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.data import se3
from slam.data.cloud import Array
from slam.data.pose_files import read_poses
from slam.loops.scan_context import (
    DEFAULT,
    Candidate,
    ScanContext,
    descriptor,
    distance,
    highest_points,
    levelled,
    levelled_submap,
    ring_key,
)
from slam.settings import ScanContextSettings

SMALL = ScanContextSettings(rings=3, sectors=4, max_range=30.0)
STRAIGHT_ON = ScanContextSettings(lateral_shifts=(0.0,))


def turned(xyz: Array, angle: float) -> Array:
    return (xyz @ se3.exp(np.array([0, 0, angle, 0, 0, 0]))[:3, :3].T).astype(np.float32)


def street(seed: int, length: float = 400.0) -> Array:
    """Points (N, 3) on the fronts of houses of random height and set-back, on both sides of a street along x."""
    rng, points = np.random.default_rng(seed), []
    for side in (-1, 1):
        x = -100.0
        while x < length + 100:
            width, back, height = rng.uniform(6, 15), rng.uniform(7, 14), rng.uniform(3, 12)
            along, up = np.meshgrid(np.arange(x, x + width, 0.4), np.arange(-1.5, height, 0.8))
            points.append(np.column_stack([along.ravel(), np.full(along.size, side * back), up.ravel()]))
            x += width + rng.uniform(1, 5)
    return np.concatenate(points)


def seen(world: Array, x: float, y: float = 0.0, heading: float = 0.0) -> Array:
    """The points within 60 m, in the frame of a sensor there."""
    pose = se3.exp(np.array([0, 0, heading, 0, 0, 0]))
    pose[:3, 3] = x, y, 0
    near = world[np.hypot(world[:, 0] - x, world[:, 1] - y) < 60]
    return ((near - pose[:3, 3]) @ pose[:3, :3]).astype(np.float32)


def driven(world: Array, chosen: ScanContextSettings = DEFAULT) -> ScanContext:
    """A street passed once along x, a keyframe every 2 m: keyframe i stands at x = 2 i."""
    places = ScanContext(chosen)
    for i in range(200):
        places.add(seen(world, 2.0 * i), 2.0 * i)
    return places


def random_places(count: int, chosen: ScanContextSettings) -> ScanContext:
    places = ScanContext(chosen)
    for i in range(count):
        places.add(random_cloud(i), 10.0 * i)
    return places


def random_cloud(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-70, 70, (40, 2)), rng.uniform(-1, 9, 40)]).astype(np.float32)


# ---- the descriptor


def test_descriptor_of_a_literal_cloud() -> None:
    xyz = [[5, 1, 1], [5, 2, 3], [-15, -1, -0.5], [1, 25, -2.5], [40, 0.1, 9], [2, 2, np.nan], [1, 3, np.inf]]
    expected = np.zeros((3, 4))
    expected[0, 0] = 3 + 2  # the higher of two
    expected[1, 2] = -0.5 + 2
    # below the ground, beyond the range, not finite: empty
    np.testing.assert_allclose(descriptor(np.array(xyz, np.float32), SMALL), expected, rtol=1e-6)
    np.testing.assert_allclose(ring_key(expected)[:3], [5 / 4, 1.5 / 4, 0])


@settings(max_examples=50, deadline=None)  # the first example may compile
@given(seed=st.integers(0, 1000))
def test_descriptor_does_not_depend_on_the_order_of_points(seed: int) -> None:
    xyz = random_cloud(seed)
    shuffled = np.random.default_rng(seed).permutation(xyz)
    np.testing.assert_array_equal(descriptor(xyz), descriptor(shuffled))


@settings(max_examples=50, deadline=None)  # the first example may compile
@given(seed=st.integers(0, 1000), sectors=st.integers(0, 59))
def test_a_yaw_rotation_shifts_the_columns_and_is_recovered(seed: int, sectors: int) -> None:
    sector = 2 * np.pi / 60
    # in the middle of their cells: rounding must not carry a point into the next
    angle = (np.random.default_rng(seed).integers(0, 60, 40) + 0.5) * sector
    reach = 4.0 * (np.arange(40) % 20) + 2
    xyz = np.column_stack([reach * np.cos(angle), reach * np.sin(angle), np.linspace(-1, 8, 40)])
    before, after = descriptor(xyz), descriptor(turned(xyz, sectors * sector))
    np.testing.assert_allclose(after, np.roll(before, sectors, axis=1), atol=1e-5)
    unlike, yaw = distance(before, after)
    assert unlike == pytest.approx(0, abs=1e-6)
    assert np.cos(yaw - sectors * sector) == pytest.approx(1)
    np.testing.assert_allclose(ring_key(before), ring_key(after), rtol=1e-5)


def test_a_ring_key_tells_a_wall_on_one_side_from_the_same_heights_all_around() -> None:
    one_side, around = np.zeros((2, 1, 12), np.float32)
    one_side[0, :6], around[0] = 4.0, 2.0
    key, other = ring_key(one_side), ring_key(around)
    assert key.shape == (5,)
    np.testing.assert_allclose((key[0], other[0]), 2.0, rtol=1e-6)  # the mean heights
    # of the square wave, sampled 12 times: 2/12 |sum of 4 exp(-2 pi i k / 12)| = 8/12 / sin(pi / 12)
    assert key[1] == pytest.approx(8 / 12 / np.sin(np.pi / 12), rel=1e-5)
    np.testing.assert_allclose(other[1:], 0, atol=1e-6)


def test_a_grid_of_few_sectors_has_a_ring_key_of_the_same_size() -> None:
    assert ring_key(np.ones((3, 4), np.float32)).shape == (15,)


def naive_distance(a: Array, b: Array) -> float:
    """Equations 6 and 7 of the paper, word by word."""
    least = 1.0
    for shift in range(a.shape[1]):
        moved, cosines = np.roll(a, -shift, axis=1), []
        for one, other in zip(moved.T, b.T, strict=True):
            if one.any() and other.any():
                cosines.append(one @ other / np.linalg.norm(one) / np.linalg.norm(other))
        if cosines:
            least = min(least, 1 - float(np.mean(cosines)))
    return least


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), filled=st.floats(0, 1))
def test_distance_agrees_with_the_paper(seed: int, filled: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = (rng.uniform(0, 5, (2, 6, 12)) * (rng.random((2, 6, 12)) < filled)).astype(np.float32)
    assert distance(a, b)[0] == pytest.approx(naive_distance(a, b), abs=1e-5)


# ---- finding places again


def test_a_return_on_the_other_lane_is_recognised() -> None:
    world = street(1)
    found = driven(world).query(seen(world, 101.0, 3.5, np.pi), 1000.0)[0]
    assert abs(found.index * 2.0 - 101.0) <= 2
    assert abs(abs(found.yaw) - np.pi) < 0.11
    assert found.lateral_shift in (2.0, 4.0)  # in the reverse direction, the lane of the first pass is to the left


def test_virtual_sensors_reduce_the_distance_of_a_lane_shift() -> None:
    world = street(2)
    query = seen(world, 200.0, 4.0)
    best, plain = (driven(world, s).query(query, 1000.0)[0] for s in (DEFAULT, STRAIGHT_ON))
    assert best.index == 100
    assert best.lateral_shift == -4.0
    assert best.distance < 0.5 * plain.distance


def test_relative_pose_maps_the_query_onto_the_candidate() -> None:
    world = street(3)
    found = driven(world).query(seen(world, 150.0, 4.0, np.pi), 1000.0)[0]
    expected = se3.exp(np.array([0, 0, np.pi, 0, 0, 0]))
    expected[:3, 3] = 150.0 - 2.0 * found.index, 4.0, 0
    np.testing.assert_allclose(found.relative_pose[:3, 3], expected[:3, 3], atol=1.0)
    np.testing.assert_allclose(found.relative_pose[:3, :3], expected[:3, :3], atol=0.11)


def test_relative_pose_turns_about_the_virtual_sensor() -> None:
    T = Candidate(index=0, distance=0.1, yaw=np.pi / 2, lateral_shift=2.0).relative_pose
    np.testing.assert_allclose(T @ [0, 2, 0, 1], [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(T @ [5, 2, 1, 1], [0, 5, 1, 1], atol=1e-12)


def test_candidates_are_sorted_and_unique() -> None:
    world = street(4)
    found = driven(world).query(seen(world, 300.0, 1.0), 1000.0)
    distances = [candidate.distance for candidate in found]
    assert distances == sorted(distances)
    assert len({candidate.index for candidate in found}) == len(found) == 50


def test_equal_places_keep_the_order_of_insertion() -> None:
    places = ScanContext()
    for i in range(130):  # standing still
        places.add(random_cloud(5), float(i))
    found = places.query(random_cloud(5), 1000.0, exhaustive=True)
    assert [candidate.index for candidate in found] == list(range(130))


# ---- preselection


@pytest.mark.parametrize("count", [1, 30, 150, 230])
def test_preselection_of_all_equals_the_exhaustive_search(count: int) -> None:
    places = random_places(count, ScanContextSettings(max_preselected=230))
    for seed in (0, count // 2, 999):
        query = random_cloud(seed)
        found, all_of_them = (
            {candidate.index: candidate.distance for candidate in places.query(query, 1e5, exhaustive=exhaustive)}
            for exhaustive in (False, True)
        )
        assert found == pytest.approx(all_of_them, abs=1e-5)


def test_preselection_takes_the_nearest_ring_keys_of_all_that_are_old_enough() -> None:
    places = random_places(180, ScanContextSettings(lateral_shifts=(0.0,), max_preselected=20))
    query = random_cloud(777)
    keys = np.array([ring_key(descriptor(random_cloud(i))) for i in range(180)])
    for end in (20, 90, 130, 180):
        unlike = np.linalg.norm(keys[:end] - ring_key(descriptor(query)), axis=1)
        found = places.query(query, 10.0 * (end - 1) + 100.0)
        assert len({candidate.index for candidate in found}) == 20
        assert max(unlike[candidate.index] for candidate in found) == pytest.approx(np.sort(unlike)[19], rel=1e-5)


# ---- what is not offered


def test_recent_places_are_excluded_by_travelled_distance() -> None:
    places, cloud = ScanContext(ScanContextSettings(min_travelled_distance=50.0)), random_cloud(1)
    for travelled in (0.0, 0.5, 1.0, 40.0, 90.0):
        places.add(cloud, travelled)
    assert [candidate.index for candidate in places.query(cloud, 49.9)] == []
    assert [candidate.index for candidate in places.query(cloud, 50.5)] == [0, 1]
    assert [candidate.index for candidate in places.query(cloud, 139.0)] == [0, 1, 2, 3]


def test_decreasing_travelled_distance_is_an_error() -> None:
    places = ScanContext()
    places.add(random_cloud(0), 10.0)
    with pytest.raises(ValueError, match=r"travelled: 9\.0 m after 10\.0 m"):
        places.add(random_cloud(1), 9.0)


def test_an_empty_cloud_has_no_candidates() -> None:
    empty = np.zeros((0, 3), np.float32)
    places = ScanContext()
    assert places.query(random_cloud(0), 1000.0) == []
    places.add(empty, 0.0)
    places.add(random_cloud(0), 1.0)
    assert places.query(empty, 1000.0) == []
    assert [candidate.index for candidate in places.query(random_cloud(0), 1000.0)] == [1]
    assert len(places) == 2


# ---- clouds of several keyframes


def test_the_highest_point_of_each_column_is_kept() -> None:
    column = [[10.1, 20.1, 1.0], [10.4, 20.4, 3.0], [10.2, 20.2, np.nan]]  # of 0.5 m
    others = [[-10.1, 20.1, -1.0], [10.1, 20.6, 2.0]]
    beyond = [[0.0, 95.0, 9.0], [np.inf, 0.0, 9.0]]
    found = highest_points(np.array(column + others + beyond, np.float32), DEFAULT)
    np.testing.assert_allclose(sorted(found[:, 2]), [-1, 2, 3])


def test_the_highest_points_have_nearly_the_same_descriptor() -> None:
    xyz = street(5)
    whole, few = descriptor(xyz), highest_points(np.asarray(xyz, np.float32), DEFAULT)
    assert len(few) < 0.6 * len(xyz)
    assert distance(whole, descriptor(few))[0] < 0.02


def test_the_submap_joins_keyframes_within_its_length() -> None:
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = travelled = np.array([0.0, 4.0, 8.0, 10.0])
    clouds = [np.array([[0.0, 1.0, float(k)]], np.float32) for k in range(4)]
    np.testing.assert_allclose(
        levelled_submap(clouds, poses, travelled, 6.0), [[-6, 1, 1], [-2, 1, 2], [0, 1, 3]], atol=1e-5
    )


def test_the_submap_is_levelled_with_the_heading_ahead() -> None:
    tilted = se3.exp(np.array([0.0, 0.0, 1.0, 3.0, 2.0, 1.0])) @ se3.exp(np.array([0.1, -0.2, 0.0, 0.0, 0.0, 0.0]))
    world = np.random.default_rng(0).normal(0, 10, (20, 3))
    lidar = ((world - tilted[:3, 3]) @ tilted[:3, :3]).astype(np.float32)
    level = levelled_submap([lidar], tilted[None], np.zeros(1), 5.0)
    np.testing.assert_allclose(level[:, 2], world[:, 2] - tilted[2, 3], atol=1e-4)
    np.testing.assert_allclose(level @ levelled(tilted)[:3, :3].T + tilted[:3, 3], world, atol=1e-4)
    assert np.arctan2(*(se3.inverse(levelled(tilted)) @ tilted)[[1, 0], 0]) == pytest.approx(0, abs=1e-9)


# ---- a real loop


def test_a_revisited_street_of_kitti_00_is_recognised(real_data: Callable[[str], Path]) -> None:
    folder = real_data("kitti_00_keyframes")
    poses = read_poses(folder / "reference_tum.txt")[1]
    files = sorted((folder / "keyframes").iterdir())
    travelled = np.r_[0, np.cumsum(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1))]
    places, added = ScanContext(), range(0, 600, 4)
    for k in added:
        places.add(np.fromfile(files[k], np.float32).reshape(-1, 4)[:, :3], travelled[k])
    for k in range(608, 640, 8):
        found = places.query(np.fromfile(files[k], np.float32).reshape(-1, 4)[:, :3], travelled[k])[0]
        true = se3.inverse(poses[added[found.index]]) @ poses[k]
        assert np.linalg.norm(true[:3, 3]) < 6
        assert abs(np.arctan2(true[1, 0], true[0, 0]) - found.yaw) < 0.1
