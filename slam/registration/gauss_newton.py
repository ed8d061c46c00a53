"""Gauss-Newton optimisation on SE(3), shared by NDT and ICP, which differ in the linearisation only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from slam.data import se3
from slam.data.cloud import Array
from slam.registration.kernels import clustered_scatter
from slam.registration.result import RegistrationResult
from slam.registration.voxels import hash_table

STOP_ROTATION, STOP_TRANSLATION = 1e-3, 1e-2  # radians, metres: tighter thresholds gave no accuracy on KITTI
CLUSTER_SIZE = 4.0  # m; points this close may share an error: of the laser, the cell or the interpolation
MIN_VARIANCE = 1e-12  # rad^2, m^2; keeps the covariance positive definite for any points
RIDGE = 1e-9  # relative to the trace of H; an unconstrained direction takes no step instead of an arbitrary one
NOT_LOCKED = np.zeros((0, 6))  # no locked directions


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Quadratic model of a method's cost at one pose.

    The perturbation is a rotation about the sensor and a translation of the sensor, in the target's axes.

    Attributes:
        H: Gauss-Newton Hessian (6, 6).
        gradient: Gradient (6,).
        variance: Variance of the whitened residuals.
        inlier_ratio: As in `RegistrationResult`.
        overlap: As in `RegistrationResult`.
        score: The paper's eq. 5 divided by the number of points; higher is better.
    """

    H: Array
    gradient: Array
    variance: float
    inlier_ratio: float
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
    pose, free = guess, null_space(locked) if len(locked) else np.eye(6)
    for _ in range(max_iterations):
        model = linearise(pose)
        step = -free @ _solve(free.T @ model.H @ free, free.T @ model.gradient)
        pose = _perturbed(pose, step)
        if np.linalg.norm(step[:3]) < STOP_ROTATION and np.linalg.norm(step[3:]) < STOP_TRANSLATION:
            return pose, True
    return pose, False


def result(model: Linearisation, pose: Array, converged: bool, xyz: Array, scores: Array) -> RegistrationResult:
    """Return the registration result with its covariances, in the source's axes.

    Args:
        model: Linearisation at `pose`.
        pose: Final pose (4, 4).
        converged: Whether the iteration converged.
        xyz: Points (N, 3).
        scores: Contribution (N, 6) of each point to the gradient.
    """
    rotation = np.zeros((6, 6))
    rotation[:3, :3] = rotation[3:, 3:] = pose[:3, :3]
    H = rotation.T @ model.H @ rotation
    scatter = rotation.T @ clustered_scatter(xyz, scores, CLUSTER_SIZE, hash_table(len(xyz))) @ rotation
    return RegistrationResult(
        pose=pose,
        H=H,
        covariance=model.variance * _solve(H, np.eye(6)),
        sandwich=_solve(H, _solve(H, scatter).T) + MIN_VARIANCE * np.eye(6),
        inlier_ratio=model.inlier_ratio,
        overlap=model.overlap,
        converged=converged,
    )


def _solve(H: Array, rhs: Array) -> Array:
    """Solution of the linear system of the normal matrix H, with a small ridge."""
    scale = max(float(np.trace(H)), 1e-12)
    return np.linalg.solve(H + RIDGE * scale * np.eye(len(H)), rhs)


def _perturbed(pose: Array, step: Array) -> Array:
    """The pose (4, 4) rotated about the sensor and translated by the step (6,), both in the target's axes."""
    perturbed = se3.normalized(se3.exp(np.concatenate([step[:3], np.zeros(3)])) @ pose)
    perturbed[:3, 3] = pose[:3, 3] + step[3:]
    return perturbed
