"""Covariance of the pose of every frame, from the pose graph of the keyframes and the odometry between them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.pose_graph import PoseGraph, symmetric
from slam.graph.solver import pose_covariances

RIDGE = 1e-18 * np.eye(6)  # rad², m²: two scans at one place have a motion without error, whose inverse is needed


def frame_covariances(poses: Array, motions: Array, keyframes: Array, graph: PoseGraph) -> Array:
    """Compute the covariances (N, 6, 6) of the poses of frames relative to the first frame, each in its own axes.

    A keyframe has its marginal covariance in the graph. A frame between two keyframes has that of the chain of motions
    from one to the other, given both, to first order. Memory and time are linear in N.

    Args:
        poses: (N, 4, 4) of frames 0, 1 ..
        motions: (N, 6, 6) covariance of the motion of each frame since the one before, in the frame's axes.
        keyframes: (K,) frames of the keyframes, increasing.
        graph: Their K poses at the optimum, and the edges between them.

    Returns:
        The covariances, zero for frame 0.
    """
    steps = [np.eye(6)] + [se3.adjoint(se3.inverse(here) @ before) for before, here in pairwise(poses)]
    covariances = np.zeros((len(poses), 6, 6))
    first, last = (int(keyframes[0]), int(keyframes[-1])) if len(keyframes) else (len(poses) - 1,) * 2
    _chain(covariances, motions, steps, range(1, first + 1))
    if len(keyframes):
        own, cross = pose_covariances(graph.edges, graph.poses)
        to_first = [se3.adjoint(se3.inverse(poses[frame]) @ poses[first]) for frame in keyframes]
        start = covariances[first].copy()
        for k, (frame, Ad) in enumerate(zip(keyframes, to_first, strict=True)):
            covariances[frame] = symmetric(own[k] + Ad @ start @ Ad.T)
        for k, (before, after) in enumerate(pairwise(keyframes.tolist())):
            joint = cross[k] + to_first[k] @ start @ to_first[k + 1].T
            _between(covariances, motions, steps, before, after, joint)
    _chain(covariances, motions, steps, range(last + 1, len(poses)))
    return covariances


def _chain(covariances: Array, motions: Array, steps: list[Array], frames: range) -> None:
    """Extend the covariances from frame to frame (Barfoot, State Estimation for Robotics, eq. 7.300)."""
    for frame in frames:
        Ad = steps[frame]
        covariances[frame] = symmetric(Ad @ covariances[frame - 1] @ Ad.T + motions[frame])


def _between(covariances: Array, motions: Array, steps: list[Array], before: int, after: int, joint: Array) -> None:
    """Fill the covariances of the frames between two keyframes, whose cross-covariance is `joint`.

    In the axes of such a frame, let A be the covariance of the motion from the first keyframe to it and B that of the
    motion from it to the second. Given the errors a and b of the two, its own error has the mean
    B (A + B)^-1 a + A (A + B)^-1 b and the covariance A (A + B)^-1 B.
    """
    frames = range(before + 1, after)
    ahead = {after: np.zeros((6, 6))}  # B of each frame
    onward = {after: np.eye(6)}  # adjoint from the second keyframe's axes into those of each frame
    for frame in reversed(frames):
        back = np.linalg.inv(steps[frame + 1])
        ahead[frame] = back @ (motions[frame + 1] + ahead[frame + 1]) @ back.T
        onward[frame] = back @ onward[frame + 1]
    A, since = np.zeros((6, 6)), np.eye(6)
    for frame in frames:
        A, since = steps[frame] @ A @ steps[frame].T + motions[frame], steps[frame] @ since
        to_after = np.linalg.solve(A + ahead[frame] + RIDGE, A).T  # A (A + B)^-1
        weights = np.hstack([(np.eye(6) - to_after) @ since, to_after @ onward[frame]])
        ends = np.block([[covariances[before], joint], [joint.T, covariances[after]]])
        covariances[frame] = symmetric(weights @ ends @ weights.T + to_after @ ahead[frame])
