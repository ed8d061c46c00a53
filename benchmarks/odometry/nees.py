"""Whether the covariance of an odometry is true: normalised estimation error squared (NEES) of its motions."""

from __future__ import annotations

import numpy as np

from slam.data import se3
from slam.data.cloud import Array

START = 5  # motions that do not count: the first maps
AXES = ("roll", "pitch", "yaw", "x", "y", "z")  # of a tangent vector


def motion_errors(poses: Array, truth: Array) -> Array:
    """(N - 1, 6): xi with motion @ exp(xi) the true motion, of poses (N, 4, 4) from frame to frame."""
    motion, true_motion = (se3.inverse(path[:-1]) @ path[1:] for path in (poses, truth))
    return np.array([se3.log(error) for error in se3.inverse(motion) @ true_motion]).reshape(-1, 6)


def nees(poses: Array, covariances: Array, truth: Array) -> float:
    """Compute the mean NEES per degree of freedom, 1 for consistent covariances.

    Bar-Shalom et al., Estimation with Applications to Tracking and Navigation, 5.4.2.

    Args:
        poses: (N, 4, 4).
        covariances: (N, 6, 6), each of pose @ exp(xi) given the pose before, xi = (rotation, translation).
        truth: (N, 4, 4).
    """
    errors = motion_errors(poses, truth)[START:]
    values = [xi @ np.linalg.solve(C, xi) / 6 for xi, C in zip(errors, covariances[1 + START :], strict=True)]
    return float(np.mean(values))


def nees_by_axis(poses: Array, covariances: Array, truth: Array) -> dict[str, float]:
    """The same along each of AXES alone: mean of squared error by variance."""
    errors = motion_errors(poses, truth)[START:]
    variances = np.diagonal(covariances, axis1=1, axis2=2)[1 + START :]
    return dict(zip(AXES, (errors**2 / variances).mean(axis=0).tolist(), strict=True))
