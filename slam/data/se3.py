"""Rigid motions as 4x4 matrices `T_a_b` (frame b to frame a); tangent vectors have the rotation first, as in GTSAM."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array

EYE = np.eye(3)


def skew(v: Array) -> Array:
    """Return the cross-product matrix (3, 3) of v (3,): its product with w is v x w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _exponentials(omega: Array) -> tuple[Array, Array]:
    """Rotation R (3, 3) of a rotation vector [rad], and V of SE(3)'s exponential: translation = V @ v.

    Barfoot, State Estimation for Robotics, eq. 7.14 and 7.86.
    """
    angle, K = math.sqrt(omega @ omega), skew(omega)
    squared = K @ K
    if angle < 1e-6:
        return EYE + K + squared / 2, EYE + K / 2 + squared / 6
    versine = 2 * (math.sin(angle / 2) / angle) ** 2
    R = EYE + math.sin(angle) / angle * K + versine * squared
    return R, EYE + versine * K + (angle - math.sin(angle)) / angle**3 * squared


def exp(xi: Array) -> Array:
    """Return the pose (4, 4) of a tangent vector (6,), rotation [rad] first, then translation [m]."""
    T = np.eye(4)
    T[:3, :3], V = _exponentials(xi[:3])
    T[:3, 3] = V @ xi[3:]
    return T


def log(T: Array) -> Array:
    """Return the tangent vector (6,) of a pose (4, 4): the inverse of `exp` for rotations below pi."""
    omega = _rotation_vector(T[:3, :3].tolist())
    return np.concatenate([omega, np.linalg.solve(_exponentials(omega)[1], T[:3, 3])])


def _rotation_vector(R: list[list[float]]) -> Array:
    """Rotation vector (3,) [rad] of a rotation matrix, by the quaternion's largest component (Shepperd 1978)."""
    (a, b, c), (d, e, f), (g, h, i) = R
    candidates = (
        (a + e + i, (1 + a + e + i, h - f, c - g, d - b)),
        (a, (h - f, 1 + a - e - i, b + d, c + g)),
        (e, (c - g, b + d, 1 - a + e - i, f + h)),
        (i, (d - b, c + g, f + h, 1 - a - e + i)),
    )
    w, *vector = max(candidates)[1]
    length = math.hypot(*vector)
    turn = 2 * math.atan2(length, abs(w))
    factor = turn / length if length > 1e-12 else 2 / abs(w)
    return math.copysign(factor, w) * np.array(vector)


def inverse(T: Array) -> Array:
    """Invert one pose (4, 4) or a stack (N, 4, 4)."""
    rotation = np.swapaxes(T[..., :3, :3], -1, -2)
    result = np.zeros_like(T)
    result[..., :3, :3] = rotation
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, T[..., :3, 3])
    result[..., 3, 3] = 1.0
    return result


def angle(T: Array) -> Array:
    """Return the rotation angle [rad] of a pose (4, 4) or of a stack (N, 4, 4)."""
    R = T[..., :3, :3]
    axis = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1)
    return np.arctan2(np.linalg.norm(axis, axis=-1), np.trace(R, axis1=-2, axis2=-1) - 1)


def scale(T: Array, factor: float) -> Array:
    """Scale a motion at constant velocity to `factor` times its duration: exp(factor * log(T))."""
    return exp(factor * log(T))


def adjoint(T: Array) -> Array:
    """Return the adjoint (6, 6) of `T_a_b` (4, 4): it maps tangent vectors, rotation first, from frame b to frame a."""
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = T[:3, :3]
    result[3:, :3] = skew(T[:3, 3]) @ T[:3, :3]
    return result


def interpolate(stamps: Array, poses: Array, at: Array) -> Array:
    """Interpolate poses at times `at` (M,): SLERP for the rotation, linear for the translation.

    Args:
        stamps: (N,) increasing times of the samples [s].
        poses: (N, 4, 4) samples.
        at: (M,) times [s]; outside the samples, the first or the last pose is returned.

    Returns:
        Poses (M, 4, 4).
    """
    before, after, share = neighbours(stamps, at)
    return blend(poses[before], poses[after], share)


def neighbours(stamps: Array, at: Array) -> tuple[Array, Array, Array]:
    """Find the samples at increasing `stamps` (N,) before and after times `at` (M,), and the fraction between them.

    Returns:
        Three arrays (M,): index before, index after, fraction 0..1. Times outside the samples are clipped to them.
    """
    before = np.clip(np.searchsorted(stamps, at, side="right") - 1, 0, max(len(stamps) - 2, 0))
    after = np.minimum(before + 1, len(stamps) - 1)
    share = (at - stamps[before]) / np.where(after > before, stamps[after] - stamps[before], 1)
    return before, after, np.clip(share, 0, 1)


def blend(start: Array, end: Array, share: Array) -> Array:
    """Interpolate (M, 4, 4) at fractions `share` (M,) between `start` and `end`, (M, 4, 4) each: SLERP and linear."""
    rotation, share = Rotation.from_matrix(start[:, :3, :3]), share[:, None]
    turn = (rotation.inv() * Rotation.from_matrix(end[:, :3, :3])).as_rotvec()
    result = np.tile(np.eye(4), (len(share), 1, 1))
    result[:, :3, :3] = (rotation * Rotation.from_rotvec(share * turn)).as_matrix()
    result[:, :3, 3] = (1 - share) * start[:, :3, 3] + share * end[:, :3, 3]
    return result


def normalized(T: Array) -> Array:
    """Orthonormalise the rotation of a pose (4, 4): rounding errors accumulate when poses are chained."""
    result = T.copy()
    U, _, Vt = np.linalg.svd(T[:3, :3])
    result[:3, :3] = U @ Vt
    return result


def from_first(poses: Array) -> Array | None:
    """Return poses (N, 4, 4) relative to the first one that is not NaN; None if all are NaN."""
    known = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
    return inverse(poses[known[0]]) @ poses if len(known) else None
