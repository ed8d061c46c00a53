"""Clusters of consistent loops: close to each other along both passes, and in agreement through the odometry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data import se3
from slam.graph.pose_graph import Edge, chained, reversed_edge

CLUSTER_RADIUS = 10  # maximum number of poses between two loops of a cluster, along either pass
QUANTILES = {0.5: 5.348, 0.9999: 27.86}  # of chi^2(6)
MIN_PAIRS = 20  # neighbouring loops needed to estimate the noise
MARGIN = 10.0  # factor on the observed standard deviation, since neighbouring loops share errors


class LoopClusters:
    """Clusters of loops that agree.

    Many graphs state far too large covariances (parking-garage 1 m instead of 1 cm), and false loops would pass. The
    agreement of neighbouring loops shows the true noise: the threshold shrinks with the median of their cycle errors,
    with a margin of 10 standard deviations since neighbours share errors, and it never grows.

    Args:
        loops: Loop edges.
        odometry: Edge k joins pose k to k + 1.

    Attributes:
        threshold: Squared Mahalanobis distance beyond which two measurements contradict each other: the 99.99 %
            quantile of chi^2(6), scaled by the observed noise.
    """

    def __init__(self, loops: Sequence[Edge], odometry: Sequence[Edge]) -> None:
        self._loops, self._odometry = loops, odometry
        self._ends = np.array([[loop.i, loop.j] for loop in loops]).reshape(-1, 2)
        self._between: dict[tuple[int, int], Edge] = {}
        self.threshold = QUANTILES[0.9999] * self._noise_scale()

    def groups(self) -> list[list[int]]:
        """Group the indices of the loops: all members are near the first one of their group, and agree with it."""
        groups = []
        waiting = np.array(sorted(range(len(self._loops)), key=lambda n: (*self._ends[n], n)), dtype=int)
        while len(waiting):
            first, rest = int(waiting[0]), waiting[1:]
            near = np.abs(self._ends[rest] - self._ends[first]).max(axis=1) <= CLUSTER_RADIUS
            joins = near.copy()
            joins[near] = [self._disagreement(first, int(n)) < self.threshold for n in rest[near]]
            groups.append([first, *(int(n) for n in rest[joins])])
            waiting = rest[~joins]
        return groups

    def _noise_scale(self) -> float:
        """Upper bound of the ratio of the observed to the stated variance, at most 1."""
        found = [
            self._disagreement(n, other) for n in range(len(self._loops)) if (other := self._nearest(n)) is not None
        ]
        agreeing = [value for value in found if value < QUANTILES[0.9999]]
        if len(agreeing) < MIN_PAIRS:
            return 1.0
        return min(1.0, MARGIN**2 * float(np.median(agreeing)) / QUANTILES[0.5])

    def _nearest(self, n: int) -> int | None:
        """The loop with the ends nearest to those of loop n, if one is within CLUSTER_RADIUS."""
        apart = np.abs(self._ends - self._ends[n]).max(axis=1)
        apart[n] = CLUSTER_RADIUS + 1
        nearest = int(apart.argmin())
        return nearest if apart[nearest] <= CLUSTER_RADIUS else None

    def _disagreement(self, first: int, second: int) -> float:
        """Squared Mahalanobis distance of the cycle of two loops and the odometry between them."""
        one, other = self._loops[first], self._loops[second]
        path = [self._odometry_edge(other.i, one.i), one, self._odometry_edge(one.j, other.j)]
        through = chained([edge for edge in path if edge is not None])
        error = se3.log(se3.inverse(other.pose) @ through.pose)
        return float(error @ np.linalg.solve(through.covariance + other.covariance, error))

    def _odometry_edge(self, a: int, b: int) -> Edge | None:
        """Odometry edge T_a_b; None if a = b."""
        if a == b:
            return None
        if (a, b) not in self._between:
            low, high = min(a, b), max(a, b)
            edge = chained(self._odometry[low:high])
            self._between[a, b] = edge if a < b else reversed_edge(edge)
        return self._between[a, b]
