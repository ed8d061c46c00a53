"""ATE and RPE of a trajectory by evo, and its path length."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from eval.alignment import Alignment, alignment_transform, as_evo
from slam.data.cloud import Array

#: Definition of each figure of this file, printed with it.
PROTOCOL = {
    "ate": "evo APE, translation part, metres, no scale; aligned = SE(3) Umeyama over all positions, "
    "origin = first pose aligned to first pose, unaligned = without alignment",
    "rpe": "evo RPE over consecutive frames (delta 1 frame): frame = translation part in metres, "
    "frame_rotation = angle in degrees; alignment does not change it",
    "paper_table_iii": "Table III of the paper: RPE of the translation over consecutive frames (delta 1 frame) "
    "after SE(3) Umeyama alignment, metres",
}


@dataclass(frozen=True)
class Statistics:
    """evo's seven statistics of an error over the frames, in the error's unit.

    Attributes:
        rmse: Root mean square error.
        mean: Arithmetic mean.
        median: Median.
        std: Population standard deviation.
        min: Minimum.
        max: Maximum.
        sse: Sum of squared errors, in the unit's square.
    """

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    sse: float

    @classmethod
    def from_dict(cls, values: Mapping[str, float]) -> Statistics:
        """Build the statistics from evo's names and values.

        Raises:
            KeyError: One is missing.
        """
        return cls(*(values[name] for name in STATISTICS))


#: The names of the seven statistics, in evo's order.
STATISTICS = tuple(field.name for field in fields(Statistics))


def ate(estimate: Array, reference: Array, alignment: Alignment = "aligned") -> Statistics:
    """Compute the absolute trajectory error |T p_i - g_i| over positions p of the estimate, g of the reference.

    Definition: Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", IROS 2012 (there: rmse, aligned),
    by evo's APE of the translation part.

    Args:
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (N, 4, 4) [m] of the same body at the same instants.
        alignment: The alignment T, see `alignment_transform`.

    Returns:
        The statistics [m] of the N errors.

    Example:
        >>> line = np.tile(np.eye(4), (3, 1, 1)); line[:, 0, 3] = [0, 1, 2]
        >>> shifted = line.copy(); shifted[:, 1, 3] = 0.5
        >>> round(ate(shifted, line, "unaligned").rmse, 6), round(ate(shifted, line, "origin").rmse, 6)
        (0.5, 0.0)
    """
    from evo.core.metrics import APE, PoseRelation

    T, _ = alignment_transform(estimate, reference, alignment)
    metric = APE(PoseRelation.translation_part)
    metric.process_data((as_evo(reference), as_evo(T @ estimate)))
    return _statistics(metric)


def rpe_translation(estimate: Array, reference: Array) -> Statistics:
    """Compute the translational RPE over consecutive frames: |trans(inv(inv(g_i) g_i+1) inv(e_i) e_i+1)|.

    Definition: Sturm et al., IROS 2012, eq. 1-2 with delta = 1 frame, by evo's RPE of the translation part. It is
    invariant to a rigid motion of the whole estimate.

    Args:
        estimate: Poses e (N, 4, 4) [m], N >= 2.
        reference: Poses g (N, 4, 4) [m] of the same body at the same instants.

    Returns:
        The statistics [m] of the N - 1 errors.

    Example:
        >>> line = np.tile(np.eye(4), (3, 1, 1)); line[:, 0, 3] = [0, 1, 2]
        >>> hasty = line.copy(); hasty[:, 0, 3] = [0, 1.1, 2.4]
        >>> round(rpe_translation(hasty, line).min, 6), round(rpe_translation(hasty, line).max, 6)
        (0.1, 0.3)
    """
    from evo.core.metrics import PoseRelation

    return _rpe(estimate, reference, PoseRelation.translation_part)


def rpe_rotation(estimate: Array, reference: Array) -> Statistics:
    """Compute the rotational RPE over consecutive frames: the rotation angle of the error of `rpe_translation`.

    Args:
        estimate: Poses (N, 4, 4), N >= 2.
        reference: Poses (N, 4, 4) of the same body at the same instants.

    Returns:
        The statistics [deg] of the N - 1 errors.
    """
    from evo.core.metrics import PoseRelation

    return _rpe(estimate, reference, PoseRelation.rotation_angle_deg)


def paper_table_iii(estimate: Array, reference: Array) -> Statistics:
    """Compute the error of the paper's Table III: translational RPE, delta 1 frame, after SE(3) Umeyama alignment.

    The authors' published log shows that the table prints this error (over 30 pairs) and not the ATE. As an RPE it
    equals `rpe_translation`; the alignment is kept because it is part of the definition.

    Args:
        estimate: Poses (N, 4, 4) [m], N >= 2.
        reference: Poses (N, 4, 4) [m] of the same body at the same instants.

    Returns:
        The statistics [m] of the N - 1 errors.
    """
    T, _ = alignment_transform(estimate, reference, "aligned")
    return rpe_translation(T @ estimate, reference)


def distances(poses: Array) -> Array:
    """Return the travelled distance (N,) [m] from the first to each of the poses (N, 4, 4), along straight segments."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1))])


def path_length(poses: Array) -> float:
    """Return the travelled distance [m] over the poses (N, 4, 4), along straight segments."""
    return float(distances(poses)[-1])


def _rpe(estimate: Array, reference: Array, relation: Any) -> Statistics:
    from evo.core.metrics import RPE, Unit

    metric = RPE(relation, delta=1, delta_unit=Unit.frames)
    metric.process_data((as_evo(reference), as_evo(estimate)))
    return _statistics(metric)


def _statistics(metric: Any) -> Statistics:
    return Statistics.from_dict({name: float(value) for name, value in metric.get_all_statistics().items()})
