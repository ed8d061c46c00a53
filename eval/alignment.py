"""Association of poses by stamp, and rigid alignment of one trajectory to another."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from slam.data import se3
from slam.data.cloud import Array

#: How an estimate is aligned to its reference before positions are compared.
Alignment = Literal["aligned", "origin", "unaligned"]

#: Largest difference between the stamps of associated poses [s]; evo's default.
MAX_STAMP_DIFFERENCE = 0.01

NOT_UNIQUE = (
    "the positions lie on a point or a line, so the SE(3) Umeyama alignment is not unique: "
    "the optimum that fits the orientations best was taken"
)


def as_evo(poses: Array) -> Any:
    """Convert poses (N, 4, 4) into an evo path."""
    from evo.core.trajectory import PosePath3D

    return PosePath3D(poses_se3=list(poses))


def associate(stamps: Array, reference_stamps: Array) -> tuple[Array, Array]:
    """Associate poses whose stamps agree within 0.01 s, as evo does.

    Trajectories with identical stamps, such as a run and its ground truth, are associated pose by pose, even if stamps
    repeat.

    Args:
        stamps: Stamps of the estimate (N,) [s], increasing.
        reference_stamps: Stamps of the reference (M,) [s], increasing, of the same clock.

    Returns:
        Indices (K,) into the estimate and (K,) into the reference.

    Example:
        >>> associate(np.array([0.0, 0.1, 0.2]), np.array([0.104, 0.2, 0.3]))
        (array([1, 2]), array([0, 1]))
    """
    from evo.core.sync import matching_time_indices

    if np.array_equal(stamps, reference_stamps):
        return np.arange(len(stamps)), np.arange(len(stamps))
    if len(stamps) <= len(reference_stamps):
        ours, theirs = matching_time_indices(stamps, reference_stamps, MAX_STAMP_DIFFERENCE)
    else:
        theirs, ours = matching_time_indices(reference_stamps, stamps, MAX_STAMP_DIFFERENCE)
    return np.array(ours, int), np.array(theirs, int)


def nearest_rotation(M: Array) -> Array:
    """Return the rotation R (3, 3) that maximises trace(R^T M), M (3, 3) (Kabsch 1976; Umeyama 1991, lemma).

    Example:
        >>> bool(np.allclose(nearest_rotation(np.diag([2.0, 3.0, 4.0])), np.eye(3)))
        True
    """
    U, _, Vt = np.linalg.svd(M)
    return np.asarray(U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))]) @ Vt)


def umeyama(estimate: Array, reference: Array) -> tuple[Array, bool]:
    """Return the rigid motion T that minimises sum |g_i - T p_i|^2 over positions p (estimate) and g (reference).

    Definition: Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991,
    without scale, by evo. If the trajectory stands still or is exactly straight, the covariance has rank 0 or 1 and evo
    raises a GeometryException: the residual is still well defined, the rotation is not. The rotation is then chosen by
    the orientations, as a second term with a vanishing weight.

    Args:
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (N, 4, 4) [m] of the same body at the same instants.

    Returns:
        T (4, 4), which maps the world frame of the estimate into that of the reference, and whether it is unique.
    """
    from evo.core.geometry import GeometryException, umeyama_alignment

    x, y = estimate[:, :3, 3], reference[:, :3, 3]
    T = np.eye(4)
    try:
        T[:3, :3], T[:3, 3], _ = umeyama_alignment(x.T, y.T)
        return T, True
    except GeometryException:
        covariance = (y - y.mean(0)).T @ (x - x.mean(0))
        orientations = np.einsum("nij,nkj->ik", reference[:, :3, :3], estimate[:, :3, :3]) / len(x)
        weight = 1e-9 * (np.linalg.norm(covariance) or 1.0)
        T[:3, :3] = nearest_rotation(covariance + weight * orientations)
        T[:3, 3] = y.mean(0) - T[:3, :3] @ x.mean(0)
        return T, False


def alignment_transform(estimate: Array, reference: Array, alignment: Alignment) -> tuple[Array, bool]:
    """Return the rigid motion that aligns an estimate to its reference.

    Args:
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (N, 4, 4) [m] of the same body at the same instants.
        alignment: "aligned": SE(3) Umeyama over all positions, no scale; "origin": aligns the first pose, position and
            orientation, with that of the reference; "unaligned": identity.

    Returns:
        T (4, 4), to be multiplied from the left to each pose of the estimate, and whether it is unique.

    Example:
        >>> start = np.eye(4)[None]; moved = start.copy(); moved[0, :3, 3] = [5, 6, 7]
        >>> alignment_transform(start, moved, "origin")[0][:3, 3]
        array([5., 6., 7.])
    """
    if alignment == "aligned":
        return umeyama(estimate, reference)
    if alignment == "origin":
        return reference[0] @ se3.inverse(estimate[0]), True
    return np.eye(4), True
