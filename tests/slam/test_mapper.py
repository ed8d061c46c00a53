"""Keyframes, loops and the pose graph behind the odometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.config import load_config
from slam.data import se3
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.mapper import Mapper
from slam.mapping_result import LoopProgress, MappingResult, corrected_poses
from slam.odometry import OdometryStep

SIDE = 36.0  # metres, of a square block that is driven around
AGAIN = 20.0  # metres on along its first side
Status = Literal["registered", "degenerate"]
STEP = 2.0  # metres from scan to scan, each of which becomes a keyframe


def block(seed: int) -> Array:
    """Points on walls, posts and boxes around the block, different on each side."""
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(170):
        place = rng.uniform(-30, SIDE + 30, 2)
        to_street = np.abs(np.array([place[0], place[0] - SIDE, place[1], place[1] - SIDE])).min()
        if to_street < 5 and (place > -5).all() and (place < SIDE + 5).all():
            continue
        size = rng.uniform(0.4, 5, 3) * [1, 1, 2]
        points = rng.uniform(-0.5, 0.5, (300, 3)) * size
        face, axis = rng.choice([-0.5, 0.5], 300), rng.integers(0, 2, 300)
        points[np.arange(300), axis] = face * size[axis]
        parts.append(points + np.array([*place, size[2] / 2 - 1.7]))
    ground = np.column_stack([rng.uniform(-40, SIDE + 40, (20_000, 2)), np.full(20_000, -1.7)])
    return np.concatenate([*parts, ground])


def way() -> Array:
    """Poses (N, 4, 4), one every STEP metres, for one round and AGAIN more."""
    poses, metres = [], np.arange(0, 4 * SIDE + AGAIN, STEP)
    corners = np.array([[0, 0], [SIDE, 0], [SIDE, SIDE], [0, SIDE]])
    for metre in metres:
        side, along = int(metre // SIDE) % 4, metre % SIDE
        yaw = side * np.pi / 2
        pose = se3.exp(np.array([0, 0, yaw, 0, 0, 0]))
        pose[:2, 3] = corners[side] + along * np.array([np.cos(yaw), np.sin(yaw)])
        poses.append(pose)
    return np.array(poses)


@pytest.fixture(scope="module")
def scans() -> list[PointCloud]:
    world, clouds = block(1), []
    for pose in way():
        local = se3.inverse(pose)
        points = world @ local[:3, :3].T + local[:3, 3]
        points = points[np.linalg.norm(points, axis=1) < 45]
        clouds.append(PointCloud(points.astype(np.float32), np.zeros(len(points))))
    return clouds


def drifting(poses: Array) -> Array:
    """Poses of an odometry with a heading drift of 0.06 deg per metre."""
    motion = se3.inverse(poses[:-1]) @ poses[1:]
    drift = se3.exp(STEP * np.array([0, 0, np.deg2rad(0.06), 0.004, 0, 0]))
    result = [poses[0]]
    for step in motion:
        result.append(result[-1] @ step @ drift)
    return np.array(result)


def mapped(
    scans: list[PointCloud],
    poses: Array,
    *overrides: str,
    status: Status = "registered",
    on_loops: Callable[[LoopProgress], None] | None = None,
) -> MappingResult:
    with Mapper(load_config(None, overrides), on_loops) as mapper:
        for position, (scan, pose) in enumerate(zip(scans, poses, strict=True)):
            step = OdometryStep(pose, 1e-6 * np.eye(6), status, None, scan)
            mapper.add(position, Frame(position, 0.1 * position, scan), scan, step)
        return mapper.finish()


@pytest.fixture(scope="module")
def mapping(scans: list[PointCloud]) -> MappingResult:
    return mapped(scans, drifting(way()))


def distance(poses: Array, truth: Array) -> Array:
    return np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1)


def test_known_places_only_get_poses(scans: list[PointCloud], mapping: MappingResult) -> None:
    """On the way again along the first side, no keyframe but the ends of the revisit is in the map."""
    truth, found = way(), mapped(scans, drifting(way()), "keyframes.max_visits=1")
    assert len(mapping.known) == 0
    assert len(found.known) >= 3
    assert found.known.min() > 4 * SIDE / STEP
    assert len(found.keyframes) == len(mapping.keyframes)
    assert distance(found.corrected(drifting(truth)), truth).max() < 0.5
    assert {record.reason for record in found.ledger if record.candidate.j in found.known} == {"known place"}
    assert found.loops == mapping.loops


def test_a_loop_removes_drift(mapping: MappingResult) -> None:
    truth = way()
    odometry = drifting(truth)
    corrected = mapping.corrected(odometry)
    assert mapping.loops >= 5
    np.testing.assert_allclose(corrected[0], truth[0], atol=1e-3)
    end = slice(-int(AGAIN / STEP), None)
    assert distance(odometry, truth)[end].min() > 2.0
    assert distance(corrected, truth)[end].max() < 0.5
    for record in mapping.ledger:
        if record.status == "accepted":
            i, j = mapping.keyframes.indices[[record.candidate.i, record.candidate.j]]
            error = se3.inverse(se3.inverse(truth[i]) @ truth[j]) @ record.candidate.pose
            assert np.linalg.norm(error[:3, 3]) < 0.5


def test_mapping_is_deterministic(mapping: MappingResult, scans: list[PointCloud]) -> None:
    again = mapped(scans, drifting(way()))
    assert mapping.poses.tobytes() == again.poses.tobytes()
    assert mapping.map.xyz.tobytes() == again.map.xyz.tobytes()


def test_loops_can_be_watched_and_stay_the_same_bit_for_bit(mapping: MappingResult, scans: list[PointCloud]) -> None:
    seen: list[LoopProgress] = []
    watched = mapped(scans, drifting(way()), on_loops=seen.append)
    assert watched.poses.tobytes() == mapping.poses.tobytes()
    counts = [len(progress.loops) for progress in seen]
    assert counts == sorted(set(counts))
    assert counts[-1] >= mapping.loops
    i, j = seen[0].loops[0]
    truth = way()
    assert np.linalg.norm(truth[i, :3, 3] - truth[j, :3, 3]) < 8
    corrected = seen[-1].corrected(drifting(truth)[: len(seen[-1].indices)])
    assert distance(corrected, truth[: len(corrected)]).max() < 0.5


def test_without_loops_the_poses_are_the_odometry(scans: list[PointCloud]) -> None:
    odometry = drifting(way())
    mapping = mapped(scans, odometry, "loops.enabled=false")
    assert len(mapping.ledger) == 0
    np.testing.assert_array_equal(mapping.corrected(odometry), odometry)
    np.testing.assert_array_equal(mapping.poses, mapping.keyframes.poses)


def test_degenerate_scans_are_mapped_like_others(mapping: MappingResult, scans: list[PointCloud]) -> None:
    degenerate = mapped(scans, drifting(way()), status="degenerate")
    assert degenerate.loops == mapping.loops
    assert degenerate.poses.tobytes() == mapping.poses.tobytes()
    assert degenerate.map.xyz.tobytes() == mapping.map.xyz.tobytes()


def test_failed_scans_make_no_keyframes(scans: list[PointCloud]) -> None:
    with Mapper(load_config()) as mapper:
        step = OdometryStep(np.eye(4), np.eye(6), "failed", None, scans[0])
        mapper.add(0, Frame(0, 0.0, scans[0]), scans[0], step)
        mapping = mapper.finish()
    assert len(mapping.keyframes) == len(mapping.map) == 0
    np.testing.assert_array_equal(mapping.corrected(np.eye(4)[None]), np.eye(4)[None])


def test_exceptions_of_the_thread_are_raised(scans: list[PointCloud]) -> None:
    def broken() -> Array:
        raise OSError("no such image")

    frame = Frame(0, 0.0, scans[0], Calibration(np.eye(3), np.eye(4)), broken)
    step = OdometryStep(np.eye(4), np.eye(6), "registered", None, scans[0])
    with Mapper(load_config()) as mapper:
        mapper.add(0, frame, scans[0], step)
        with pytest.raises(OSError, match="no such image"):
            mapper.finish()


# ---- frames between keyframes

AT = np.array([2, 5, 9])  # keyframes among twelve frames, half a metre apart
motions = st.tuples(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.lists(st.floats(-1e4, 1e4), min_size=3, max_size=3)
).map(lambda parts: se3.exp(np.array(parts[0] + parts[1])))


def straight(start: Array) -> Array:
    """Twelve poses (12, 4, 4) on a straight line."""
    return np.array([start @ se3.exp(np.array([0, 0, 0, 0.5 * number, 0, 0])) for number in range(12)])


def bent(keyframes: Array, degrees: float) -> Array:
    """The same keyframes (K, 4, 4) with a rotation to the left between successive ones."""
    turn, result = se3.exp(np.array([0, 0, np.deg2rad(degrees), 0, 0, 0])), [keyframes[0]]
    for motion in se3.inverse(keyframes[:-1]) @ keyframes[1:]:
        result.append(result[-1] @ turn @ motion)
    return np.array(result)


@given(odometry=motions, world=motions, bend=st.floats(-10, 10))
def test_corrections_do_not_depend_on_the_origin(odometry: Array, world: Array, bend: float) -> None:
    """Origins of the odometry's and the optimised world, each moved by up to 10 km and 60 deg per axis."""
    poses = straight(np.eye(4))
    optimised = bent(poses[AT], bend)
    near = corrected_poses(poses, AT, poses[AT], optimised)
    far = corrected_poses(odometry @ poses, AT, odometry @ poses[AT], world @ optimised)
    np.testing.assert_allclose(far, world @ near, atol=1e-7)


@given(start=motions, bend=st.floats(-10, 10))
def test_keyframes_have_their_optimised_poses_and_correct_the_ends(start: Array, bend: float) -> None:
    poses = straight(start)
    optimised = bent(poses[AT], bend)
    found = corrected_poses(poses, AT, poses[AT], optimised)
    np.testing.assert_allclose(found[AT], optimised, atol=1e-7)
    for ends, keyframe in ((slice(0, 2), 0), (slice(10, 12), 2)):
        seen = se3.inverse(poses[AT[keyframe]]) @ poses[ends]
        np.testing.assert_allclose(found[ends], optimised[keyframe] @ seen, atol=1e-7)


@pytest.mark.parametrize("away", [0.0, 2000.0, 10000.0])
def test_corrected_frames_stay_on_the_path_far_from_the_start(away: float) -> None:
    """At most 1.5 m from the straight line between two keyframes with corrections that differ by 2 deg."""
    start = se3.exp(np.array([0, 0, 0.3, away, 0, 0]))
    poses = straight(start)
    optimised = bent(poses[AT], 2.0)
    found = corrected_poses(poses, AT, poses[AT], optimised)
    seen = se3.inverse(optimised[0]) @ found[AT[0] : AT[1]]
    end = (se3.inverse(optimised[0]) @ optimised[1])[:3, 3]
    aside = np.linalg.norm(np.cross(seen[:, :3, 3], end / np.linalg.norm(end)), axis=1)
    assert aside.max() < 0.03
