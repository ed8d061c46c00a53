"""Whether the covariances of an odometry's motions are consistent: NEES from frame to frame, and over longer ways."""

from __future__ import annotations

import numpy as np

from eval import consistency
from slam.data import se3
from slam.data.cloud import Array
from slam.graph.drift import MotionErrors
from slam.graph.pose_graph import PoseGraph
from slam.graph.uncertainty import frame_covariances
from slam.settings import KeyframeSettings

START = 5  # motions that do not count: the first maps
KEYFRAMES = (1, 10, 50)  # lengths of motions
ABSOLUTE = "poses"  # relative to the first pose
MIN_MOTIONS = 5  # fewer are no sample
MAX_MOTIONS = 100  # of a length, evenly spaced: they overlap
NO_GRAPH = (np.zeros(0, int), PoseGraph(np.zeros((0, 4, 4)), ()))


def motion_errors(poses: Array, truth: Array) -> Array:
    """(N - 1, 6): xi with motion @ exp(xi) the true motion, of poses (N, 4, 4) from frame to frame."""
    motion, true_motion = (se3.inverse(path[:-1]) @ path[1:] for path in (poses, truth))
    return np.array([se3.log(error) for error in se3.inverse(motion) @ true_motion]).reshape(-1, 6)


def nees(poses: Array, covariances: Array, truth: Array) -> float:
    """Compute the mean NEES per degree of freedom, 1 for consistent covariances.

    Args:
        poses: (N, 4, 4).
        covariances: (N, 6, 6), each of pose @ exp(xi) given the pose before, xi = (rotation, translation).
        truth: (N, 4, 4).
    """
    return consistency.nees(motion_errors(poses, truth)[START:], covariances[1 + START :])


def nees_by_axis(poses: Array, covariances: Array, truth: Array) -> dict[str, float]:
    """The same along each of `AXES` alone: mean of squared error by variance."""
    return consistency.nees_by_axis(motion_errors(poses, truth)[START:], covariances[1 + START :])


def nees_over_keyframes(poses: Array, errors: MotionErrors, truth: Array) -> dict[str, dict[str, float]]:
    """NEES of motions over `KEYFRAMES` keyframes, and of the poses relative to the first (`ABSOLUTE`), without loops.

    Each has the entries "all" and those of `nees_by_axis`. Lengths with fewer than `MIN_MOTIONS` motions are left out.

    Args:
        poses: (N, 4, 4).
        errors: Of the frames.
        truth: (N, 4, 4).
    """
    keyframes = [frame for frame in _keyframes(poses) if frame >= START]
    pairs = {str(n): list(zip(keyframes, keyframes[n:], strict=False)) for n in KEYFRAMES}
    pairs[ABSOLUTE] = [(0, frame) for frame in keyframes]
    return {
        name: _nees_of_pairs(poses, errors, truth, some[:: 1 + len(some) // MAX_MOTIONS])
        for name, some in pairs.items()
        if len(some) >= MIN_MOTIONS
    }


def _keyframes(poses: Array) -> list[int]:
    """Frames at the distance of keyframes from each other."""
    frames = [0]
    for frame, pose in enumerate(poses):
        if np.linalg.norm((pose - poses[frames[-1]])[:3, 3]) >= KeyframeSettings().distance:
            frames.append(frame)
    return frames


def _nees_of_pairs(poses: Array, errors: MotionErrors, truth: Array, pairs: list[tuple[int, int]]) -> dict[str, float]:
    found, covariances = [], []
    for i, j in pairs:
        found.append(motion_errors(poses[[i, j]], truth[[i, j]])[0])
        between = MotionErrors(*(part[i : j + 1] for part in (errors.own, errors.drift, errors.hidden)))
        covariances.append(frame_covariances(poses[i : j + 1], between, *NO_GRAPH)[-1])
    by_axis = consistency.nees_by_axis(np.array(found), np.array(covariances))
    return {"all": consistency.nees(np.array(found), np.array(covariances))} | by_axis
