"""Whether the covariances of poses are consistent with their errors: normalised estimation error squared (NEES)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.covariance_file import AXES

#: Definition of the figure, printed with it.
PROTOCOL = {
    "nees": "mean NEES per degree of freedom of the poses relative to the first one, which is aligned to the "
    "reference (Bar-Shalom et al., Estimation with Applications to Tracking and Navigation, 5.4.2): 1 where "
    "covariances are consistent, above 1 where they are too small; errors of successive poses are correlated, so one "
    "trajectory is little more than one sample, and an error of the reference counts as one of the estimate",
}


@dataclass(frozen=True)
class Consistency:
    """NEES of a trajectory, each figure per degree of freedom and as a mean over the poses.

    Attributes:
        frames: Number of poses that were compared.
        pose: Of the whole pose.
        rotation: Of the rotation alone.
        translation: Of the translation alone.
        by_axis: Along each of `AXES` alone: squared error by variance.
    """

    frames: int
    pose: float
    rotation: float
    translation: float
    by_axis: Mapping[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Return the entry "nees" of metrics.json."""
        return asdict(self)


def consistency(estimate: Array, covariances: Array, reference: Array) -> Consistency | None:
    """Evaluate the covariances of a trajectory.

    Args:
        estimate: Poses (N, 4, 4) [m].
        covariances: (N, 6, 6) of pose @ exp(xi) relative to the first pose, xi = (rotation, translation).
        reference: Poses (N, 4, 4) [m] of the same body at the same instants.

    Returns:
        The figures over all poses but the first, which has no error; None for a single pose.
    """
    if len(estimate) < 2:
        return None
    relative, true = (se3.inverse(poses[0]) @ poses[1:] for poses in (estimate, reference))
    errors = np.array([se3.log(se3.normalized(error)) for error in se3.inverse(relative) @ true])
    covariances = covariances[1:]
    return Consistency(
        frames=len(errors),
        pose=nees(errors, covariances),
        rotation=nees(errors[:, :3], covariances[:, :3, :3]),
        translation=nees(errors[:, 3:], covariances[:, 3:, 3:]),
        by_axis=nees_by_axis(errors, covariances),
    )


def nees(errors: Array, covariances: Array) -> float:
    """Compute the mean NEES per degree of freedom of errors (N, D) with covariances (N, D, D).

    Example:
        >>> nees(np.array([[2.0, 0.0], [0.0, 1.0]]), np.array([np.eye(2), np.eye(2)]))
        1.25
    """
    solved = np.linalg.solve(covariances, errors[..., None])[..., 0]
    return float((errors * solved).sum(axis=1).mean() / errors.shape[1])


def nees_by_axis(errors: Array, covariances: Array) -> dict[str, float]:
    """Compute the mean of squared error by variance along each of `AXES`, of errors (N, 6), covariances (N, 6, 6)."""
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    return dict(zip(AXES, (errors**2 / variances).mean(axis=0).tolist(), strict=True))
