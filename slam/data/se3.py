"""Rigid motions as 4x4 matrices `T_a_b` (frame b into frame a); tangent vectors: rotation first, as in GTSAM."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array


def skew(v: Array) -> Array:
    """(3,) -> (3, 3) with skew(v) @ w = v x w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _left_jacobian(omega: Array) -> Array:
    """V of SE(3)'s exponential: translation = V @ v (Barfoot, State Estimation for Robotics, eq. 7.86)."""
    angle, K = float(np.linalg.norm(omega)), skew(omega)
    if angle < 1e-6:
        return np.eye(3) + K / 2 + K @ K / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * K + (angle - np.sin(angle)) / angle**3 * (K @ K)


def exp(xi: Array) -> Array:
    """Tangent vector (6,), rotation [rad] first, then translation [m] -> pose (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(xi[:3]).as_matrix()
    T[:3, 3] = _left_jacobian(xi[:3]) @ xi[3:]
    return T


def log(T: Array) -> Array:
    """Inverse of `exp` for rotations below pi: (4, 4) -> (6,)."""
    omega = Rotation.from_matrix(T[:3, :3]).as_rotvec()
    return np.concatenate([omega, np.linalg.solve(_left_jacobian(omega), T[:3, 3])])


def inverse(T: Array) -> Array:
    """Inverse of one pose (4, 4) or of a stack (N, 4, 4)."""
    rotation = np.swapaxes(T[..., :3, :3], -1, -2)
    result = np.zeros_like(T)
    result[..., :3, :3] = rotation
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, T[..., :3, 3])
    result[..., 3, 3] = 1.0
    return result


def angle(T: Array) -> Array:
    """Rotation angle [rad] of a pose (4, 4) or of a stack (N, 4, 4)."""
    return np.asarray(Rotation.from_matrix(T[..., :3, :3]).magnitude())


def scale(T: Array, factor: float) -> Array:
    """The same motion continued for `factor` times as long: exp(factor * log(T))."""
    return exp(factor * log(T))


def adjoint(T: Array) -> Array:
    """(6, 6) that takes a tangent vector of frame b, rotation first, to frame a; `T_a_b` (4, 4)."""
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = T[:3, :3]
    result[3:, :3] = skew(T[:3, 3]) @ T[:3, :3]
    return result


def interpolate(stamps: Array, poses: Array, at: Array) -> Array:
    """Poses (M, 4, 4) at times `at` (M,), between samples (N, 4, 4) at rising `stamps` (N,): SLERP and linear.

    Times outside the samples take the first or the last pose.
    """
    before, after, share = neighbours(stamps, at)
    return blend(poses[before], poses[after], share)


def neighbours(stamps: Array, at: Array) -> tuple[Array, Array, Array]:
    """Which samples, at rising `stamps` (N,), lie before and after times `at` (M,), and the share of the way.

    Three arrays (M,). The share is 0..1: times outside the samples are at the first or the last.
    """
    before = np.clip(np.searchsorted(stamps, at, side="right") - 1, 0, max(len(stamps) - 2, 0))
    after = np.minimum(before + 1, len(stamps) - 1)
    share = (at - stamps[before]) / np.where(after > before, stamps[after] - stamps[before], 1)
    return before, after, np.clip(share, 0, 1)


def blend(start: Array, end: Array, share: Array) -> Array:
    """Poses (M, 4, 4) a share (M,) of the way from `start` to `end`, (M, 4, 4) each: SLERP and linear."""
    rotation, share = Rotation.from_matrix(start[:, :3, :3]), share[:, None]
    turn = (rotation.inv() * Rotation.from_matrix(end[:, :3, :3])).as_rotvec()
    result = np.tile(np.eye(4), (len(share), 1, 1))
    result[:, :3, :3] = (rotation * Rotation.from_rotvec(share * turn)).as_matrix()
    result[:, :3, 3] = (1 - share) * start[:, :3, 3] + share * end[:, :3, 3]
    return result


def normalized(T: Array) -> Array:
    """The pose (4, 4) with its rotation made orthonormal again: rounding grows when poses are chained."""
    result = T.copy()
    result[:3, :3] = Rotation.from_matrix(T[:3, :3]).as_matrix()
    return result


def from_first(poses: Array) -> Array | None:
    """Poses (N, 4, 4) in the frame of the first one that is not NaN; None where all are."""
    known = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
    return inverse(poses[known[0]]) @ poses if len(known) else None
