"""Gauss-Newton optimisation on SE(3), shared by NDT and ICP, which differ in the linearisation only."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from slam.data.cloud import Array
from slam.registration.kernels import clustered_sums, stepped
from slam.registration.result import RegistrationResult
from slam.registration.voxels import hash_table

STOP_ROTATION, STOP_TRANSLATION = 1e-3, 1e-2  # radians, metres: tighter thresholds gave no accuracy on KITTI
CLUSTER_SIZE = 4.0  # m; points this close may share an error: of the laser, the cell or the interpolation
MIN_VARIANCE = 1e-12  # rad^2, m^2; keeps the covariance positive definite for any points
RIDGE = 1e-9  # relative to the trace of H; an unconstrained direction takes no step instead of an arbitrary one
NOT_LOCKED = np.zeros((0, 6))  # no locked directions
ALL_FREE = np.eye(6)  # a step may be taken in any direction


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Quadratic model of a method's cost at one pose.

    The perturbation is a rotation about the sensor and a translation of the sensor, in the target's axes.

    Attributes:
        H: Gauss-Newton Hessian (6, 6).
        gradient: Gradient (6,).
        variance: Variance of the whitened residuals.
        inlier_ratio: As in `RegistrationResult`.
        upright_inlier_ratio: As in `RegistrationResult`, if the contributions to the gradient were asked for.
        overlap: As in `RegistrationResult`.
        score: The paper's eq. 5 divided by the number of points, 0 if it was not asked for; higher is better.
    """

    H: Array
    gradient: Array
    variance: float
    inlier_ratio: float
    upright_inlier_ratio: float
    overlap: float
    score: float


def minimise(
    linearise: Callable[[Array], Linearisation],
    guess: Array,
    max_iterations: int,
    locked: Array = NOT_LOCKED,
) -> tuple[Array, bool]:
    """Iterate Gauss-Newton steps until a step is below STOP_ROTATION and STOP_TRANSLATION.

    Args:
        linearise: Returns the linearisation at a pose (4, 4).
        guess: Initial pose (4, 4).
        max_iterations: Maximum number of steps.
        locked: Directions (K, 6), orthonormal and in the target's axes, along which no step is taken (solution
            remapping, Zhang, Kaess, Singh, ICRA 2016).

    Returns:
        The pose (4, 4), and whether the iteration converged.
    """
    pose, free = guess, np.ascontiguousarray(null_space(locked)) if len(locked) else ALL_FREE
    for _ in range(max_iterations):
        model = linearise(pose)
        pose, step = stepped(pose, model.H, model.gradient, free, RIDGE)
        if math.hypot(*step[:3]) < STOP_ROTATION and math.hypot(*step[3:]) < STOP_TRANSLATION:
            return pose, True
    return pose, False


def result(
    model: Linearisation, pose: Array, converged: bool, xyz: Array, scores: Array, locked: Array
) -> RegistrationResult:
    """Return the registration result with its covariances, in the source's axes.

    The step that would follow is part of the sandwich: in a bend, where the prediction is far off, what the thresholds
    of `minimise` leave is more than the noise. (Taking it halves the error of the yaw there, but not the ATE.)

    Args:
        model: Linearisation at `pose`.
        pose: Pose (4, 4) after the last iteration.
        converged: Whether the iteration converged.
        xyz: Points (N, 3).
        scores: Contribution (N, 6) of each point to the gradient.
        locked: As in `minimise`.
    """
    rotation = _rotation(pose)
    step = rotation.T @ _step(model, locked)
    H = rotation.T @ model.H @ rotation
    sums = clustered_sums(xyz, scores, CLUSTER_SIZE, hash_table(len(xyz))) @ rotation
    return RegistrationResult(
        pose=pose,
        H=H,
        covariance=model.variance * _solve(H, np.eye(6)),
        sandwich=_solve(H, _solve(H, sums.T @ sums).T) + np.outer(step, step) + MIN_VARIANCE * np.eye(6),
        inlier_ratio=model.inlier_ratio,
        upright_inlier_ratio=model.upright_inlier_ratio,
        overlap=model.overlap,
        converged=converged,
    )


def distortion_response(H: Array, H_time: Array, pose: Array) -> Array:
    """Return how a registered pose follows the distortion of its scan: xi = response (6, 6) @ v, to first order.

    A scan that was deskewed with a velocity error v (6,) [rad/s, m/s] has its points displaced by (J v) t, with their
    times t from the middle of the sweep. The least-squares pose @ exp(xi) compensates this by
    xi = -inv(sum of J^T S J) (sum of J^T S J t) v.

    Args:
        H: Hessian (6, 6) of the registration, in the source's axes.
        H_time: Hessian (6, 6) with the points' weights multiplied by their times [s], in the target's axes.
        pose: Registered pose (4, 4).
    """
    rotation = _rotation(pose)
    return -_solve(H, rotation.T @ H_time @ rotation)


def _rotation(pose: Array) -> Array:
    """The matrix (6, 6) that rotates the two halves of a tangent vector."""
    rotation = np.zeros((6, 6))
    rotation[:3, :3] = rotation[3:, 3:] = pose[:3, :3]
    return rotation


def _step(model: Linearisation, locked: Array) -> Array:
    """The Gauss-Newton step (6,), without its part along the locked directions."""
    if not len(locked):
        return -_solve(model.H, model.gradient)
    free = null_space(locked)
    return np.asarray(-free @ _solve(free.T @ model.H @ free, free.T @ model.gradient))


def _solve(H: Array, rhs: Array) -> Array:
    """Solution of the linear system of the normal matrix H, with a small ridge."""
    scale = max(float(np.trace(H)), 1e-12)
    return np.linalg.solve(H + RIDGE * scale * np.eye(len(H)), rhs)
