"""Order of a trajectory's quaternions: w last, as in TUM's format, or w first, as in EuRoC's.

Both orders give smooth rotations with the same angle between poses. Only the right one is consistent with the
positions: a vehicle moves in one direction of its body, and rotates about the same axis as its LiDAR.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array
from slam.data.conventions import ORDERS

#: Maximum number and minimum length [m] of the chords that a trajectory is divided into.
CHORDS, SHORTEST = 200, 0.5
ENOUGH = 8  # minimum number of chords for an order other than TUM's
SIDEWAYS = 0.1  # maximum sideways share: of the squared displacement, not along the body's axis of travel
#: Minimum factor and value of the sideways share by the other order: for TUM's order, and for the other.
CLEARLY = {"xyzw": (4.0, 0.01), "wxyz": (10.0, 0.02)}
FORWARD = 0.9  # mean cosine of the angle between the direction of travel and the body's x axis
WINDOW = 10  # frames between which motions are compared: over one frame, the noise of the reference may dominate
FITS = 0.2  # maximum difference of two trajectories, as a share of the squared motion
FEWEST = 0.25  # maximum difference by the right order, as a share of that by the other order
SAME = 1e-6  # maximum difference of equal trajectories, as a share of the squared motion
SAMPLES = 5000  # maximum number of poses from which chords are made


def as_rotations(quaternions: Array, order: str) -> Array:
    """Convert quaternions (N, 4), in the given order, to rotation matrices (N, 3, 3)."""
    return np.asarray(Rotation.from_quat(quaternions, scalar_first=order == "wxyz").as_matrix())


def order_by_motion(readings: Mapping[str, Array]) -> str | None:
    """Estimate the order of the quaternions: the one by which the body moves along one of its axes.

    If both orders do, as on a straight road, the one by which it moves along the body's x, as a LiDAR does, is taken; a
    car that reverses by TUM's order may drive forward by the other. With few poses, only TUM's order is accepted.

    Args:
        readings: Poses (N, 4, 4) by each of the two orders, sorted by time.

    Returns:
        The order, or None if the motion does not determine it.
    """
    chords = {order: _travel_directions(poses) for order, poses in readings.items()}
    if count := len(chords["xyzw"]):
        sideways = {order: 1 - float(np.linalg.eigvalsh(rays.T @ rays / count)[-1]) for order, rays in chords.items()}
        forward = {order: float(rays[:, 0].mean()) for order, rays in chords.items()}
        for order, other in (ORDERS, ORDERS[::-1]):
            times, least = CLEARLY[order]
            turned = sideways[order] < SIDEWAYS and sideways[other] > max(times * sideways[order], least)
            ahead = forward[order] > FORWARD and (forward[other] if order == "xyzw" else abs(forward[other])) < FORWARD
            if (turned or ahead) and (order == "xyzw" or count >= ENOUGH):
                return order
    return "xyzw" if _difference(*readings.values()) < SAME else None


def orders_by_odometry(readings: Mapping[str, Array], odometry: Array) -> tuple[str, ...]:
    """Return the orders that agree with the motion by the odometry: one, none, or both if they are equivalent.

    Args:
        readings: Poses (N, 4, 4) of the same frames by each of the two orders, NaN for unknown ones.
        odometry: Poses (N, 4, 4).
    """
    off = {order: _difference(odometry, poses) for order, poses in readings.items()}
    best, other = sorted(ORDERS, key=off.__getitem__)
    if off[best] < min(FITS, FEWEST * off[other]):
        return (best,)
    return ORDERS if off[other] < FITS else ()


def _travel_directions(poses: Array) -> Array:
    """Directions of travel (M, 3), unit vectors, between poses some distance apart, in the body's axes halfway."""
    poses = poses[:: max(1, len(poses) // SAMPLES)]
    extent = float(np.linalg.norm(np.ptp(poses[:, :3, 3], axis=0)))
    step = max(SHORTEST, extent / CHORDS)
    chosen = [0]
    for number, position in enumerate(poses[:, :3, 3]):
        if np.linalg.norm(position - poses[chosen[-1], :3, 3]) >= step:
            chosen.append(number)
    start, end = poses[chosen[:-1]], poses[chosen[1:]]
    displacements = end[:, :3, 3] - start[:, :3, 3]
    seen = np.einsum("nji,nj->ni", start[:, :3, :3] + end[:, :3, :3], displacements)
    length = np.linalg.norm(seen, axis=1, keepdims=True)
    return np.asarray(seen / np.maximum(length, 1e-9))


def _difference(seen: Array, read: Array) -> float:
    """Difference of two trajectories (N, 4, 4), as a share of the squared motion over WINDOW frames.

    The mean over translation and rotation, each only if it is above the noise.
    """
    window = min(WINDOW, max(len(seen) - 1, 1))
    first = np.arange(max(len(seen) - window, 0))
    known = np.isfinite(read[first]).all(axis=(1, 2)) & np.isfinite(read[first + window]).all(axis=(1, 2))
    first = first[known]
    motions = [se3.inverse(poses[first]) @ poses[first + window] for poses in (seen, read)]
    displacements = [motion[:, :3, 3] for motion in motions]
    turns = [Rotation.from_matrix(motion[:, :3, :3]).as_rotvec() for motion in motions]
    parts = []
    for (ours, theirs), least in ((displacements, 0.3), (turns, 0.02)):  # m, rad: noise level
        size = float((ours**2).sum(axis=1).mean()) if len(ours) else 0.0
        if size > least**2:
            parts.append(float(((ours - theirs) ** 2).sum(axis=1).mean()) / size)
    return float(np.mean(parts)) if parts else 0.0
