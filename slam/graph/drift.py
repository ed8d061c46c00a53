"""Errors of an odometry along a trajectory: those of each registration, and the drift of the local map.

A scan is registered against a map of many scans, so that the error of its registration ends with it: errors of
successive motions are anticorrelated, and their covariances must not be added. What accumulates is the drift of the
map, into which the errors of all scans enter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array

#: Travelled distance [m] over which the map drifts as much as one registration errs (1 sigma). Calibrated on simulated
#: drives, where it fits streets, a tunnel, a motorway and rooms alike: benchmarks/results/observability.md.
DRIFT_LENGTH = 1.0
#: The same for roll and pitch while the map is younger than `YOUNG` [m]: sparse rings follow them by half, since they
#: meet the traces of the same rings.
YOUNG_DRIFT_LENGTH, YOUNG = 0.01, 15.0
MIN_DISTANCE = 1e-3  # m per motion; keeps the drift of a standing sensor positive definite
NO_DRIFT = 1e-12 * np.eye(6)  # rad^2, m^2; positive definite too
ENDS = 2  # a motion from scan to scan has the errors of two registrations


@dataclass(frozen=True, eq=False)
class MotionErrors:
    """Covariances of the errors of frames, in the sensor's axes: of pose @ exp(xi), xi = (rotation, translation).

    Attributes:
        own: (N, 6, 6) of each pose relative to the local map. They do not accumulate.
        drift: (N, 6, 6) of the motion of the local map since the frame before. They accumulate.
        hidden: (N, 6, 6) the same, where loops do not correct it: their submaps are bent alike.
    """

    own: Array
    drift: Array
    hidden: Array


def accumulating(covariances: Array) -> MotionErrors:
    """Return errors that are independent from motion to motion, as from scan to scan; covariances (N, 6, 6)."""
    return MotionErrors(np.zeros_like(covariances), covariances, np.zeros_like(covariances))


def map_errors(
    poses: Array, covariances: Array, unobserved: Sequence[Array], failed: Array, starts: Sequence[int] = ()
) -> MotionErrors:
    """Return the errors of an odometry that registers scans against a local map.

    Each pose has half of the covariance of its motion. The drift grows with the travelled distance, in proportion to
    it; along unobservable directions, where the pose is the prediction, all of the covariance accumulates. The error of
    a failed scan ends with it, since the next one meets the map again; only before the first map all errors accumulate.

    Args:
        poses: (N, 4, 4).
        covariances: (N, 6, 6) of the motion of each frame since the one before.
        unobserved: Unit vectors (K, 6) of each frame, empty unless degenerate.
        failed: (N,) bool, frames that kept the prediction.
        starts: Frames at which a new map began, besides the first one.
    """
    own, drift, hidden = covariances / ENDS, np.zeros_like(covariances), np.zeros_like(covariances)
    for frame, directions in enumerate(unobserved):
        if len(directions):
            P = np.eye(6) - directions.T @ directions  # projects onto the observable directions
            observed = P @ covariances[frame] @ P
            own[frame], drift[frame] = observed / ENDS, covariances[frame] - observed
    distances = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0, prepend=poses[:1, :3, 3]), axis=1)
    share = np.maximum(distances, MIN_DISTANCE) / DRIFT_LENGTH
    registered = np.flatnonzero(~failed)
    drift[registered] += share[registered, None, None] * own[registered]
    for frame in registered[_since(starts, distances)[registered] < YOUNG]:
        hidden[frame, :2, :2] = distances[frame] / YOUNG_DRIFT_LENGTH * own[frame, :2, :2]
    own[failed], drift[failed] = covariances[failed], NO_DRIFT
    _begin(own, drift, covariances, registered)
    return MotionErrors(own, drift, hidden)


def _since(starts: Sequence[int], distances: Array) -> Array:
    """Travelled distances (N,) [m] since the map of each frame began."""
    travelled = distances.cumsum()
    begun = np.zeros(len(distances))
    for start in starts:
        begun[start:] = travelled[start]
    return np.asarray(travelled - begun)


def _begin(own: Array, drift: Array, covariances: Array, registered: Array) -> None:
    """Set the errors of the first frames, in place.

    The first registered scan is the first map, without an error of its own, but the map that grows from it has the
    errors of the following ones: relative to that map, the first scan is as far off as the second one.
    """
    first = int(registered[0]) if len(registered) else len(own)
    own[:first], drift[: first + 1] = 0.0, covariances[: first + 1]
    if len(registered) > 1:
        own[first] = own[registered[1]]
