"""Errors along a path: error at its end in the direction of travel, frame of the largest error, reported errors."""

from __future__ import annotations

import numpy as np

from slam.data import se3
from slam.data.cloud import Array

ENOUGH = 1.0  # m of travelled distance from which the direction of travel is estimated


def along_track_error(estimate: Array, truth: Array) -> float | None:
    """How far ahead of the truth an estimate ends, behind it where negative [m].

    Args:
        estimate: Poses (N, 4, 4), put onto the truth by their first.
        truth: Poses (N, 4, 4) of the same instants.

    Returns:
        The error of the last position along the true direction of travel there, which is that from the last position
        at least a metre away. None where there is none.
    """
    away = truth[-1, :3, 3] - truth[:, :3, 3]
    far = np.flatnonzero(np.linalg.norm(away, axis=1) >= ENOUGH)
    if len(far) == 0:
        return None
    direction = away[far[-1]] / np.linalg.norm(away[far[-1]])
    end = truth[0] @ se3.inverse(estimate[0]) @ estimate[-1]
    return float(direction @ (end - truth[-1])[:3, 3])


def worst_frame(estimate: Array, truth: Array) -> tuple[int, float] | None:
    """The position in (N, 4, 4) of the frame whose motion from the frame before errs most, and by how much [m].

    The error is the translation of the RPE over one frame, as in `eval.trajectory`. None where there is no motion.
    """
    if len(truth) < 2:
        return None
    motion, true_motion = (se3.inverse(path[:-1]) @ path[1:] for path in (estimate, truth))
    errors = np.linalg.norm((se3.inverse(true_motion) @ motion)[:, :3, 3], axis=1)
    worst = int(errors.argmax())
    return worst + 1, float(errors[worst])


def errors_ahead(estimate: Array, truth: Array) -> Array:
    """(N,) by how much the motion from the frame before goes too far ahead, too little where negative [m].

    Ahead is where the sensor truly moves, see `directions`; 0 of the first frame, and where that is not known.

    Args:
        estimate: Poses (N, 4, 4).
        truth: Poses (N, 4, 4) of the same instants.
    """
    motion, true_motion = (se3.inverse(path[:-1]) @ path[1:] for path in (estimate, truth))
    ahead = np.nan_to_num(directions(truth)[:-1])
    errors = np.einsum("ni,ni->n", ahead, (motion - true_motion)[:, :3, 3])
    return np.concatenate([[0.0], errors])


def directions(truth: Array) -> Array:
    """Compute the directions of motion (N, 3), unit vectors in the sensor frame.

    They are from the frame before to the one after, or between the nearest frames that are ENOUGH apart; NaN if there
    are none.
    """
    found = np.full((len(truth), 3), np.nan)
    for frame, pose in enumerate(truth):
        reach = np.linalg.norm(truth[:, :3, 3] - pose[:3, 3], axis=1) >= ENOUGH / 2
        before, after = np.flatnonzero(reach[:frame]), frame + np.flatnonzero(reach[frame:])
        first, last = (before[-1] if len(before) else 0), (after[0] if len(after) else len(truth) - 1)
        way = truth[last, :3, 3] - truth[first, :3, 3]
        if np.linalg.norm(way) >= ENOUGH / 2:
            found[frame] = pose[:3, :3].T @ way / np.linalg.norm(way)
    return found


def corrected(estimate: Array, truth: Array, told: Array) -> Array:
    """The trajectory (N, 4, 4) that is left where what is told to be unsure is set right.

    Args:
        estimate: Poses (N, 4, 4).
        truth: Poses (N, 4, 4) of the same instants.
        told: (N,) frames whose pose was told to be unsure: the motions to them and from them are taken from the truth.
    """
    motion, true_motion = (se3.inverse(path[:-1]) @ path[1:] for path in (estimate, truth))
    unsure = told[1:] | told[:-1]
    motion[unsure] = true_motion[unsure]
    poses = [estimate[0]]
    for step in motion:
        poses.append(se3.normalized(poses[-1] @ step))
    return np.array(poses)
