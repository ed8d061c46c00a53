"""Bound on the distance between two keyframes, by the odometry between them: an early test of loop candidates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data.growing import Growing
from slam.graph.pose_graph import Edge

SIGMAS = 6.0  # standard deviations of the odometry that a candidate may contradict it: the drift is a rough model


class OdometryBound:
    """Tells whether two keyframes can be at one place, by the odometry and its covariances.

    To first order, the variance of the position of keyframe j relative to i is the sum of the variances of the motions
    in between, where that of each rotation counts by its squared distance from j. Running sums evaluate it.
    """

    def __init__(self) -> None:
        self._last = np.eye(4)  # pose of the last keyframe
        self._positions = Growing(3)
        # Per keyframe, summed over the motions up to it: the variance of the translation; r, r p, and r |p|^2, with the
        # variance r of the rotation and the position p.
        self._sums = Growing(6)
        for rows in (self._positions, self._sums):
            rows.append(0.0)

    def extend(self, odometry: Sequence[Edge]) -> None:
        """Add the motions to further keyframes; `odometry` holds all edges so far, edge k from keyframe k to k + 1."""
        for edge in odometry[len(self._sums) - 1 :]:
            self._last = self._last @ edge.pose
            rotation, translation = np.trace(edge.covariance[:3, :3]), np.trace(edge.covariance[3:, 3:])
            p = self._last[:3, 3]
            self._positions.append(p)
            self._sums.append(self._sums[-1] + [translation, rotation, *(rotation * p), rotation * (p @ p)])

    def sigma(self, i: int, j: int) -> float:
        """Return the standard deviation [m] of the position of keyframe j relative to keyframe i < j."""
        translation, rotation, *moments, squares = self._sums[j] - self._sums[i]
        p = self._positions[j]
        return float(np.sqrt(max(translation + rotation * (p @ p) - 2 * p @ moments + squares, 0.0)))

    def allows(self, i: int, j: int, distance: float) -> bool:
        """Whether keyframe j may be within a distance [m] of keyframe i < j."""
        apart = float(np.linalg.norm(self._positions[j] - self._positions[i]))
        return apart <= distance + SIGMAS * self.sigma(i, j)
