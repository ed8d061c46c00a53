"""Covariance of the pose of every frame, from the drift of the local map, the loops and each registration."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.chain import Chain
from slam.graph.drift import MotionErrors
from slam.graph.pose_graph import Edge, PoseGraph, disagreement, odometry_poses, reversed_edge, symmetric
from slam.graph.solver import pose_covariances

#: Maximum variance [m²] along an axis in the graph. Cholesky's method fails where edges of very different certainty
#: meet; beyond it an edge, as that between two segments, tells nothing to a graph that loops connect.
MAX_VARIANCE = 4.0
RIDGE = 1e-18 * np.eye(6)  # rad², m²: two scans at one place have a motion without error, whose inverse is needed


def frame_covariances(
    poses: Array, errors: MotionErrors, keyframes: Array, graph: PoseGraph, known: Collection[int] = ()
) -> Array:
    """Compute the covariances (N, 6, 6) of the poses of frames relative to the first frame, each in its own axes.

    The local map at a keyframe has its marginal covariance in a graph of the drift and the loops. Between two keyframes
    it has that of the chain of drifts from one to the other, given both, to first order. A pose has the error of its
    registration as well, and so has the first. An edge with more than `MAX_VARIANCE` counts as if it had that. Memory
    and time are linear in N.

    Args:
        poses: (N, 4, 4) of frames 0, 1 ..
        errors: Of the frames' motions.
        keyframes: (K,) frames of the keyframes, increasing.
        graph: Their K poses at the optimum; K - 1 odometry edges, of which the measured poses count, and the loops.
        known: Keyframes, by their number, that only their loops place.

    Returns:
        The covariances, zero for frame 0.
    """
    steps = [np.eye(6)] + [se3.adjoint(se3.inverse(here) @ before) for before, here in pairwise(poses)]
    covariances, motions = np.zeros((len(poses), 6, 6)), errors.drift
    first, last = (int(keyframes[0]), int(keyframes[-1])) if len(keyframes) else (len(poses) - 1,) * 2
    if len(keyframes):
        odometry, loops = graph.edges[: len(keyframes) - 1], graph.edges[len(keyframes) - 1 :]
        edges = _drift_edges(odometry, motions, steps, keyframes)
        scale = drift_scale(edges, loops)
        motions, edges = scale * motions, [replace(edge, covariance=scale * edge.covariance) for edge in edges]
        _chain(covariances, motions, steps, range(1, first + 1))
        own, cross = pose_covariances([*(_clipped(edge) for edge in _without(edges, known)), *loops], graph.poses)
        to_first = [se3.adjoint(se3.inverse(poses[frame]) @ poses[first]) for frame in keyframes]
        start = covariances[first].copy()
        for k, (frame, Ad) in enumerate(zip(keyframes, to_first, strict=True)):
            covariances[frame] = symmetric(own[k] + Ad @ start @ Ad.T)
        for k, (before, after) in enumerate(pairwise(keyframes.tolist())):
            joint = cross[k] + to_first[k] @ start @ to_first[k + 1].T
            _between(covariances, motions, steps, before, after, joint)
    _chain(covariances, motions, steps, range(last + 1 if len(keyframes) else 1, len(poses)))
    uncorrected = np.zeros_like(covariances)
    uncorrected[0] = errors.own[0]
    _chain(uncorrected, errors.hidden, steps, range(1, len(poses)))
    covariances[1:] += uncorrected[1:] + errors.own[1:]
    return covariances


def drift_scale(odometry: Sequence[Edge], loops: Sequence[Edge]) -> float:
    """Return the factor on the covariances of the odometry by which its drift explains the loops, at least 1.

    Errors that no registration shows, such as those of the laser's calibration, are seen where a loop closes. The
    factor is the mean squared Mahalanobis distance, per degree of freedom, between the loops and the odometry: the
    variance of unit weight of an adjustment (Förstner & Wrobel, Photogrammetric Computer Vision, 4.2.3).

    Args:
        odometry: Edge k joins pose k to k + 1.
        loops: Accepted loops.
    """
    if not loops:
        return 1.0
    poses = odometry_poses(odometry, np.eye(4))
    covariances = np.zeros((len(poses), 6, 6))
    for edge in odometry:
        Ad = se3.adjoint(se3.inverse(edge.pose))
        covariances[edge.j] = Ad @ covariances[edge.i] @ Ad.T + edge.covariance
    misfits = []
    for loop in loops:
        i, j = sorted((loop.i, loop.j))
        Ad = se3.adjoint(se3.inverse(poses[j]) @ poses[i])
        between = covariances[j] - Ad @ covariances[i] @ Ad.T  # the errors of the motions are independent
        misfits.append(disagreement(loop if loop.i < loop.j else reversed_edge(loop), poses, symmetric(between)))
    return max(1.0, float(np.mean(misfits)) / 6)


def _clipped(edge: Edge) -> Edge:
    """The edge with at most `MAX_VARIANCE`, the ratio of its variances unchanged."""
    return replace(edge, covariance=edge.covariance * min(1.0, MAX_VARIANCE / edge.covariance[3:, 3:].max()))


def _drift_edges(odometry: Sequence[Edge], drift: Array, steps: list[Array], keyframes: Array) -> list[Edge]:
    """The odometry edges with the sum of the drift of the frames between their keyframes."""
    edges = []
    for edge, (before, after) in zip(odometry, pairwise(keyframes.tolist()), strict=True):
        covariance = np.zeros((6, 6))
        for frame in range(before + 1, after + 1):
            covariance = steps[frame] @ covariance @ steps[frame].T + drift[frame]
        edges.append(replace(edge, covariance=symmetric(covariance)))
    return edges


def _without(odometry: Sequence[Edge], known: Collection[int]) -> list[Edge]:
    """The odometry between the poses that are not known, in one edge from each to the next."""
    chain = Chain()
    for edge in odometry:
        chain.add(edge, skip=edge.j in known)
    return [replace(edge, i=chain.nodes[edge.i], j=chain.nodes[edge.j]) for edge in chain.edges]


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
