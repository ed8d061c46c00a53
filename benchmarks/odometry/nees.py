"""Whether the covariances of an odometry's motions are consistent: NEES from frame to frame."""

from __future__ import annotations

import numpy as np

from eval import consistency
from slam.data import se3
from slam.data.cloud import Array

START = 5  # motions that do not count: the first maps


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
