"""Candidates of a keyframe."""

from __future__ import annotations

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.graph.pose_graph import Edge
from slam.loops.closing import LoopSearch
from slam.mapping.keyframes import Keyframes
from slam.settings import KeyframeSettings, LoopSettings

PLACES = 60  # keyframes, 2.5 m apart
SURROUNDINGS = np.random.default_rng(2).uniform((-25, -25, -1.5), (25, 25, 5), (4000, 3)).astype(np.float32)


def candidates_of_the_last(step: Array, covariance: Array) -> int:
    """Number of candidates of a keyframe whose surroundings look like those of all others."""
    keyframes, poses = Keyframes(KeyframeSettings(voxel_size=0.2)), [np.eye(4)]
    for _ in range(PLACES):
        poses.append(poses[-1] @ step)
    for index, pose in enumerate(poses):
        keyframes.add(PointCloud(SURROUNDINGS, np.zeros(len(SURROUNDINGS))), pose, index, 2.5 * index)
    keyframes.finish()
    odometry = [Edge(k, k + 1, step, covariance) for k in range(PLACES)]
    search = LoopSearch(LoopSettings())
    return [len(search.next(keyframes, odometry)) for _ in range(PLACES)][-1]


def test_a_place_that_looks_alike_is_no_candidate_if_the_odometry_excludes_it() -> None:
    sure, unsure = (np.diag([rotation**2] * 3 + [0.1**2] * 3) for rotation in (0.002, 0.2))
    straight = se3.exp(np.array([0, 0, 0, 2.5, 0, 0]))
    round_ = straight @ se3.exp(np.array([0, 0, 2 * np.pi / PLACES, 0, 0, 0]))
    assert candidates_of_the_last(straight, sure) == 0
    assert candidates_of_the_last(straight, unsure) > 0
    assert candidates_of_the_last(round_, sure) > 0
