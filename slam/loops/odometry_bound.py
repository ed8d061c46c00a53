"""Bound on the distance between two keyframes, by the odometry between them: an early test of loop candidates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.graph.pose_graph import Edge

SIGMAS = 6.0  # standard deviations of the odometry that a candidate may contradict it: the drift is a rough model


class OdometryBound:
    """Tells whether two keyframes can be at one place, by the odometry and its covariances.

    To first order, the variance of the position of keyframe j relative to i is the sum of the variances of the motions
    in between, where that of each rotation counts by its squared distance from j. Running sums evaluate it.
    """

    def __init__(self) -> None:
        self._poses = [np.eye(4)]
        # Per keyframe, summed over the motions up to it: the variance of the translation; r, r p, and r |p|^2, with the
        # variance r of the rotation and the position p.
        self._sums = [np.zeros(6)]

    def extend(self, odometry: Sequence[Edge]) -> None:
        """Add the motions to further keyframes; `odometry` holds all edges so far, edge k from keyframe k to k + 1."""
        for edge in odometry[len(self._poses) - 1 :]:
            pose = self._poses[-1] @ edge.pose
            rotation, translation = np.trace(edge.covariance[:3, :3]), np.trace(edge.covariance[3:, 3:])
            p = pose[:3, 3]
            self._poses.append(pose)
            self._sums.append(self._sums[-1] + [translation, rotation, *(rotation * p), rotation * (p @ p)])

    def sigma(self, i: int, j: int) -> float:
        """Return the standard deviation [m] of the position of keyframe j relative to keyframe i < j."""
        translation, rotation, *moments, squares = self._sums[j] - self._sums[i]
        p = self._poses[j][:3, 3]
        return float(np.sqrt(max(translation + rotation * (p @ p) - 2 * p @ moments + squares, 0.0)))

    def allows(self, i: int, j: int, distance: float) -> bool:
        """Whether keyframe j may be within a distance [m] of keyframe i < j."""
        apart = float(np.linalg.norm(self._poses[j][:3, 3] - self._poses[i][:3, 3]))
        return apart <= distance + SIGMAS * self.sigma(i, j)
