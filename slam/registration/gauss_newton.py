"""Gauss-Newton on SE(3), shared by NDT and ICP: they differ in how they linearise, not in how they step."""

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

STOP_ROTATION, STOP_TRANSLATION = 1e-3, 1e-2  # radians, metres: tighter brought no accuracy on KITTI
CLUSTER = 4.0  # m: points so near to each other may be wrong together, by a laser's error, a cell's, an interpolation's
LEAST_VARIANCE = 1e-12  # rad^2, m^2: positive definite whatever the points
RIDGE = 1e-9  # relative; a direction that nothing holds takes no step instead of a wild one
NOTHING = np.zeros((0, 6))  # locked


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A method's quadratic model at one pose, for a turn about the sensor and a move of it, in the target's axes.

    H (6, 6), gradient (6,), variance of the whitened residuals; the others as in RegistrationResult.
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
    model: Linearisation,
    max_iterations: int,
    locked: Array = NOTHING,
) -> tuple[Array, bool]:
    """Steps from `guess` (4, 4), where the linearisation is `model`, until one is below the thresholds: the pose, and
    whether that happened.

    Along the directions `locked` (K, 6), orthonormal and in the target's axes, no step is taken (solution remapping,
    Zhang, Kaess, Singh, ICRA 2016).
    """
    pose, free = guess, null_space(locked) if len(locked) else np.eye(6)
    for iteration in range(max_iterations):
        model = linearise(pose) if iteration else model
        step = -free @ _solve(free.T @ model.H @ free, free.T @ model.gradient)
        pose = _perturbed(pose, step)
        if np.linalg.norm(step[:3]) < STOP_ROTATION and np.linalg.norm(step[3:]) < STOP_TRANSLATION:
            return pose, True
    return pose, False


def result(model: Linearisation, pose: Array, converged: bool, xyz: Array, scores: Array) -> RegistrationResult:
    """The model at the final pose, in the source's axes, with its covariances; `scores` (N, 6) are the points' (N, 3)
    parts of the gradient."""
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = pose[:3, :3]
    H = turn.T @ model.H @ turn
    scatter = turn.T @ clustered_scatter(xyz, scores, CLUSTER, hash_table(len(xyz))) @ turn
    return RegistrationResult(
        pose=pose,
        H=H,
        covariance=model.variance * _solve(H, np.eye(6)),
        sandwich=_solve(H, _solve(H, scatter).T) + LEAST_VARIANCE * np.eye(6),
        inlier_ratio=model.inlier_ratio,
        overlap=model.overlap,
        converged=converged,
    )


def _solve(H: Array, right: Array) -> Array:
    scale = max(float(np.trace(H)), 1e-12)
    return np.linalg.solve(H + RIDGE * scale * np.eye(len(H)), right)


def _perturbed(pose: Array, step: Array) -> Array:
    moved = se3.normalized(se3.exp(np.concatenate([step[:3], np.zeros(3)])) @ pose)
    moved[:3, 3] = pose[:3, 3] + step[3:]
    return moved
