"""Covariances of the poses of frames, against a graph of all frames and against drawn motions."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.drift import accumulating
from slam.graph.pose_graph import Edge, PoseGraph, chained, odometry_poses
from slam.graph.solver import relative_covariances
from slam.graph.uncertainty import frame_covariances

FRAMES = 41
STEP = se3.exp(np.array([0, 0, 2 * np.pi / (FRAMES - 1), 1.0, 0, 0.05]))  # once around a circle, with a rise
KEYFRAMES = np.array([0, 3, 10, 11, 20, 28, 37])
LOOP = np.diag([1e-4] * 3 + [1e-3] * 3)


def _motions() -> Array:
    """Covariances (N, 6, 6), of full rank and different from frame to frame."""
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(FRAMES, 6, 6)) * np.array([[1e-3] * 3 + [2e-2] * 3]).T
    return np.asarray(roots @ roots.transpose(0, 2, 1))


def _frame_edges(motions: Array) -> list[Edge]:
    return [Edge(frame - 1, frame, STEP, motions[frame]) for frame in range(1, FRAMES)]


def _keyframe_graph(edges: list[Edge], poses: Array, keyframes: Array, loops: list[tuple[int, int]]) -> PoseGraph:
    """The keyframes' graph; `loops` are pairs of places in `keyframes`."""
    chain = [chained(edges[before:after]) for before, after in pairwise(keyframes)]
    odometry = [Edge(k, k + 1, edge.pose, edge.covariance) for k, edge in enumerate(chain)]
    relative = [se3.normalized(se3.inverse(poses[keyframes[i]]) @ poses[keyframes[j]]) for i, j in loops]
    closed = [Edge(i, j, pose, LOOP) for (i, j), pose in zip(loops, relative, strict=True)]
    return PoseGraph(se3.inverse(poses[keyframes[0]]) @ poses[keyframes], (*odometry, *closed))


@pytest.mark.parametrize("loops", [[], [(0, 6)], [(1, 5), (6, 0)]])
def test_frames_have_the_covariances_of_a_graph_of_all_frames(loops: list[tuple[int, int]]) -> None:
    motions = _motions()
    edges = _frame_edges(motions)
    poses = odometry_poses(edges, np.eye(4))
    graph = _keyframe_graph(edges, poses, KEYFRAMES, loops)
    found = frame_covariances(poses, accumulating(motions), KEYFRAMES, graph)
    closed = [
        Edge(int(KEYFRAMES[edge.i]), int(KEYFRAMES[edge.j]), edge.pose, edge.covariance)
        for edge in graph.edges[len(KEYFRAMES) - 1 :]
    ]
    whole = relative_covariances([*edges, *closed], poses, [(0, frame) for frame in range(1, FRAMES)])
    assert (found[0] == 0).all()
    for frame, expected in enumerate(whole, start=1):
        scale = np.sqrt(np.diag(expected))
        assert found[frame] / np.outer(scale, scale) == pytest.approx(expected / np.outer(scale, scale), abs=1e-4)


def test_without_keyframes_the_covariances_are_those_of_drawn_motions() -> None:
    """2000 trajectories with errors of these covariances; the spread of the last pose, in its axes."""
    motions, rng = _motions()[:11], np.random.default_rng(2)
    poses = odometry_poses(_frame_edges(_motions())[:10], np.eye(4))
    ends = []
    for _ in range(2000):
        pose = np.eye(4)
        for covariance in motions[1:]:
            pose = pose @ STEP @ se3.exp(rng.multivariate_normal(np.zeros(6), covariance))
        ends.append(se3.log(se3.inverse(poses[-1]) @ pose))
    found = frame_covariances(poses, accumulating(motions), np.zeros(0, int), PoseGraph(np.zeros((0, 4, 4)), ()))
    assert np.diag(np.cov(np.array(ends).T)) == pytest.approx(np.diag(found[-1]), rel=0.15)


def test_frames_before_the_first_keyframe_are_part_of_every_later_pose() -> None:
    """Where the first scans failed, the world is still the first frame."""
    motions = _motions()
    edges = _frame_edges(motions)
    poses = odometry_poses(edges, np.eye(4))
    late = KEYFRAMES[2:]
    whole = frame_covariances(poses, accumulating(motions), KEYFRAMES, _keyframe_graph(edges, poses, KEYFRAMES, []))
    found = frame_covariances(poses, accumulating(motions), late, _keyframe_graph(edges, poses, late, []))
    assert found == pytest.approx(whole, rel=1e-6, abs=1e-12)


def test_a_loop_makes_poses_surer_and_every_covariance_stays_positive() -> None:
    motions = _motions()
    edges = _frame_edges(motions)
    poses = odometry_poses(edges, np.eye(4))
    open_, closed = (
        frame_covariances(poses, accumulating(motions), KEYFRAMES, _keyframe_graph(edges, poses, KEYFRAMES, loops))
        for loops in ([], [(0, 6)])
    )
    assert all(np.linalg.eigvalsh(covariance)[0] > 0 for covariance in closed[1:])
    assert all(np.linalg.eigvalsh(before - after)[0] > -1e-9 for before, after in zip(open_, closed, strict=True))
    assert np.trace(closed[37]) < 0.2 * np.trace(open_[37])


def test_a_known_keyframe_is_as_sure_as_its_loop_and_the_place_it_joins() -> None:
    """Keyframes 3 and 4 are at known places: the way along them tells the later ones nothing."""
    motions = _motions()
    edges = _frame_edges(motions)
    poses = odometry_poses(edges, np.eye(4))
    graph = _keyframe_graph(edges, poses, KEYFRAMES, [(1, 5), (0, 3), (1, 4)])
    found = frame_covariances(poses, accumulating(motions), KEYFRAMES, graph, known={3, 4})
    whole = frame_covariances(poses, accumulating(motions), KEYFRAMES, graph)
    assert np.diag(found[11]) == pytest.approx(np.diag(LOOP), rel=1e-3)  # keyframe 0 is exact
    assert all(np.linalg.eigvalsh(covariance)[0] > 0 for covariance in found[1:])
    assert (np.trace(found[KEYFRAMES], axis1=1, axis2=2) >= 0.999 * np.trace(whole[KEYFRAMES], axis1=1, axis2=2)).all()
    assert np.trace(found[15]) < np.trace(found[11]) + np.trace(motions[12:16].sum(axis=0))
