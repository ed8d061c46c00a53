"""Whether a trajectory's quaternions have w last, as TUM's have, or first, as EuRoC's.

Each order gives rotations that look smooth, with the same angle from pose to pose. But only the right one fits the
positions: a vehicle moves in one direction of its own body, and turns about the axis about which its LiDAR does.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array
from slam.data.conventions import ORDERS

#: How a trajectory is cut into chords: at most so many, none shorter [m].
CHORDS, SHORTEST = 200, 0.5
ENOUGH = 8  # chords, before a file is read otherwise than TUM's format says
SIDEWAYS = 0.1  # share of the squared way that is not along the body's own axis of travel, at most
#: By the other order it is so many times more, and at least so much: for TUM's order, and for the other.
CLEARLY = {"xyzw": (4.0, 0.01), "wxyz": (10.0, 0.02)}
FORWARD = 0.9  # cosine of the angle between the usual way and the body's x axis
WINDOW = 10  # frames over which motions are compared: over one, the truth's noise may be larger than they are
FITS = 0.2  # of the squared motion, the part in which another trajectory may differ
FEWEST = 0.25  # part of the other order's difference that the right one's is at most
SAME = 1e-6  # of the squared motion: trajectories that differ by less are one
SAMPLES = 5000  # poses that chords are sought among


def as_rotations(quaternions: Array, order: str) -> Array:
    """(N, 4) as a file has them -> (N, 3, 3)."""
    return np.asarray(Rotation.from_quat(quaternions, scalar_first=order == "wxyz").as_matrix())


def order_by_motion(readings: Mapping[str, Array]) -> str | None:
    """The order by which the body moves along one of its axes; None where that does not tell.

    Where both do, as on a straight road, the one that has the way along the body's x, as a LiDAR's is; a car that
    reverses by TUM's order may as well drive ahead by the other. Few poses are never taken to be other than TUM's.

    Args:
        readings: Poses (N, 4, 4) by each of the two orders, in the order of time.
    """
    chords = {order: _chords(poses) for order, poses in readings.items()}
    if count := len(chords["xyzw"]):
        sideways = {order: 1 - float(np.linalg.eigvalsh(way.T @ way / count)[-1]) for order, way in chords.items()}
        forward = {order: float(way[:, 0].mean()) for order, way in chords.items()}
        for order, other in (ORDERS, ORDERS[::-1]):
            times, least = CLEARLY[order]
            turned = sideways[order] < SIDEWAYS and sideways[other] > max(times * sideways[order], least)
            ahead = forward[order] > FORWARD and (forward[other] if order == "xyzw" else abs(forward[other])) < FORWARD
            if (turned or ahead) and (order == "xyzw" or count >= ENOUGH):
                return order
    return "xyzw" if _difference(*readings.values()) < SAME else None


def orders_by_odometry(readings: Mapping[str, Array], odometry: Array) -> tuple[str, ...]:
    """The orders that agree with the motion that the odometry saw: one, none, or both where they mean the same.

    Args:
        readings: Poses (N, 4, 4) of the same frames by each of the two orders, NaN where unknown.
        odometry: Poses (N, 4, 4).
    """
    off = {order: _difference(odometry, poses) for order, poses in readings.items()}
    best, other = sorted(ORDERS, key=off.__getitem__)
    if off[best] < min(FITS, FEWEST * off[other]):
        return (best,)
    return ORDERS if off[other] < FITS else ()


def _chords(poses: Array) -> Array:
    """(M, 3) unit vectors: the ways between poses some distance apart, in the body's axes halfway."""
    poses = poses[:: max(1, len(poses) // SAMPLES)]
    extent = float(np.linalg.norm(np.ptp(poses[:, :3, 3], axis=0)))
    step = max(SHORTEST, extent / CHORDS)
    chosen = [0]
    for number, position in enumerate(poses[:, :3, 3]):
        if np.linalg.norm(position - poses[chosen[-1], :3, 3]) >= step:
            chosen.append(number)
    start, end = poses[chosen[:-1]], poses[chosen[1:]]
    ways = end[:, :3, 3] - start[:, :3, 3]
    seen = np.einsum("nji,nj->ni", start[:, :3, :3] + end[:, :3, :3], ways)
    length = np.linalg.norm(seen, axis=1, keepdims=True)
    return np.asarray(seen / np.maximum(length, 1e-9))


def _difference(seen: Array, read: Array) -> float:
    """The part of the squared motion over WINDOW frames in which two trajectories (N, 4, 4) differ, translation and
    rotation each by what there is of it."""
    window = min(WINDOW, max(len(seen) - 1, 1))
    first = np.arange(max(len(seen) - window, 0))
    known = np.isfinite(read[first]).all(axis=(1, 2)) & np.isfinite(read[first + window]).all(axis=(1, 2))
    first = first[known]
    motions = [se3.inverse(poses[first]) @ poses[first + window] for poses in (seen, read)]
    ways = [motion[:, :3, 3] for motion in motions]
    turns = [Rotation.from_matrix(motion[:, :3, :3]).as_rotvec() for motion in motions]
    parts = []
    for (ours, theirs), least in ((ways, 0.3), (turns, 0.02)):  # m, rad: below it is noise
        size = float((ours**2).sum(axis=1).mean()) if len(ours) else 0.0
        if size > least**2:
            parts.append(float(((ours - theirs) ** 2).sum(axis=1).mean()) / size)
    return float(np.mean(parts)) if parts else 0.0
