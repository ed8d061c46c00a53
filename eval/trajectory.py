"""ATE and RPE of a trajectory through evo, and its path length."""

from __future__ import annotations

from typing import Any

import numpy as np

from eval.alignment import Alignment, alignment_transform, as_evo
from slam.data.cloud import Array

#: rmse, mean, median, std (population), min, max, sse: evo's seven, in evo's order.
STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "sse")

#: What each figure of this file means, to be printed beside it.
PROTOCOL = {
    "ate": "evo APE, translation part, metres, no scale; aligned = SE(3) Umeyama over all positions, "
    "origin = first pose onto first pose, unaligned = as the files stand",
    "rpe": "evo RPE over consecutive frames (delta 1 frame): frame = translation part in metres, "
    "frame_rotation = angle in degrees; alignment does not change it",
    "paper_table_iii": "Table III of the paper: RPE of the translation over consecutive frames (delta 1 frame) "
    "after SE(3) Umeyama alignment, metres",
}

Statistics = dict[str, float]


def ate(estimate: Array, reference: Array, alignment: Alignment = "aligned") -> Statistics:
    """Absolute trajectory error [m]: the seven statistics of |T p_i - g_i| over positions p, g of poses (N, 4, 4).

    Definition: Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", IROS 2012 (there: rmse, aligned),
    by evo's APE of the translation part. `alignment` gives T: see `alignment_transform`.

    >>> line = np.tile(np.eye(4), (3, 1, 1)); line[:, 0, 3] = [0, 1, 2]
    >>> shifted = line.copy(); shifted[:, 1, 3] = 0.5
    >>> ate(shifted, line, "unaligned")["rmse"], ate(shifted, line, "origin")["rmse"]
    (0.5, 0.0)
    """
    from evo.core.metrics import APE, PoseRelation

    T, _ = alignment_transform(estimate, reference, alignment)
    metric = APE(PoseRelation.translation_part)
    metric.process_data((as_evo(reference), as_evo(T @ estimate)))
    return _statistics(metric)


def rpe_translation(estimate: Array, reference: Array) -> Statistics:
    """Relative pose error over consecutive frames [m]: |trans(inv(inv(g_i) g_i+1) inv(e_i) e_i+1)|, poses (N, 4, 4).

    Definition: Sturm et al., IROS 2012, eq. 1-2 with delta = 1 frame, by evo's RPE of the translation part. A rigid
    motion of the whole estimate does not change it. Needs N >= 2.
    """
    from evo.core.metrics import PoseRelation

    return _rpe(estimate, reference, PoseRelation.translation_part)


def rpe_rotation(estimate: Array, reference: Array) -> Statistics:
    """As `rpe_translation`, the angle of the error's rotation [deg]."""
    from evo.core.metrics import PoseRelation

    return _rpe(estimate, reference, PoseRelation.rotation_angle_deg)


def paper_table_iii(estimate: Array, reference: Array) -> Statistics:
    """The error in Table III of the paper [m]: RPE of the translation, delta 1 frame, after SE(3) Umeyama alignment.

    The authors' published log shows that this, not the ATE, is what the table prints (there over 30 pairs). As an RPE
    it equals `rpe_translation`; the alignment is done all the same, since it is part of the definition.
    """
    T, _ = alignment_transform(estimate, reference, "aligned")
    return rpe_translation(T @ estimate, reference)


def distances(poses: Array) -> Array:
    """Way from the first pose to each [m]: (N, 4, 4) -> (N,), the polygon through the positions."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1))])


def path_length(poses: Array) -> float:
    """Length of the polygon through the positions of (N, 4, 4) [m]."""
    return float(distances(poses)[-1])


def _rpe(estimate: Array, reference: Array, relation: Any) -> Statistics:
    from evo.core.metrics import RPE, Unit

    metric = RPE(relation, delta=1, delta_unit=Unit.frames)
    metric.process_data((as_evo(reference), as_evo(estimate)))
    return _statistics(metric)


def _statistics(metric: Any) -> Statistics:
    values = metric.get_all_statistics()
    return {name: float(values[name]) for name in STATISTICS}
