"""Where along the way a trajectory goes wrong: how far ahead it ends, and in which frame it errs most."""

from __future__ import annotations

import numpy as np

from slam.data import se3
from slam.data.cloud import Array

ENOUGH = 1.0  # m of way that tell in which direction the sensor moves


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
