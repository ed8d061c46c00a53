"""What GTSAM does for us, between arrays of poses and edges: least squares, marginals, GNC and iSAM2.

The only file that imports gtsam. Pose k of an array has key k, and the first is held at the identity. Rotation comes
first in tangent vectors and covariances, as in `pose_graph`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import gtsam
import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.pose_graph import Edge, adjoint

FIRST_SIGMA = 1e-4  # rad, m: how firmly the first pose is held at the identity
TOLERANCE = 1e-9  # of the error: where much noise is stated, GTSAM's 1e-5 is half a metre short of the optimum


def factors(edges: Iterable[Edge], kernel: Any = None) -> Any:
    """A NonlinearFactorGraph with a factor an edge, in their order; `kernel` is an m-estimator of GTSAM."""
    graph = gtsam.NonlinearFactorGraph()
    for edge in edges:
        gaussian = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        noise = gaussian if kernel is None else gtsam.noiseModel.Robust.Create(kernel, gaussian)
        graph.add(gtsam.BetweenFactorPose3(edge.i, edge.j, gtsam.Pose3(edge.pose), noise))
    return graph


def first_held() -> Any:
    """The factor that holds the first pose."""
    return gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, FIRST_SIGMA))


def values_of(poses: Array) -> Any:
    """GTSAM's Values of poses (N, 4, 4)."""
    values = gtsam.Values()
    for key, pose in enumerate(poses):
        values.insert(key, gtsam.Pose3(pose))  # a bare array would be stored as a matrix
    return values


def poses_of(values: Any) -> Array:
    """All poses (N, 4, 4) of GTSAM's Values."""
    rows = np.asarray(gtsam.utilities.extractPose3(values))  # R row by row, then t
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = rows[:, :9].reshape(-1, 3, 3)
    poses[:, :3, 3] = rows[:, 9:]
    return poses


def squared_distances(edges: Sequence[Edge], poses: Array) -> Array:
    """(E,): each edge's squared Mahalanobis distance to poses (N, 4, 4), twice what GTSAM calls its error."""
    graph, values = factors(edges), values_of(poses)
    return np.array([2 * graph.at(k).error(values) for k in range(len(edges))])


def optimised(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array) -> Array:
    """Poses (N, 4, 4) that fit all edges best, by Levenberg-Marquardt from `start`; the first stays the identity."""
    graph = factors([*odometry, *loops])
    graph.add(first_held())
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(TOLERANCE)
    return poses_of(gtsam.LevenbergMarquardtOptimizer(graph, values_of(start), parameters).optimize())


def gnc(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array, threshold: float) -> tuple[Array, Array]:
    """Poses (N, 4, 4), and (L,) bool: the loops that GNC-TLS keeps (Yang et al., RA-L 2020).

    Those are within the squared distance `threshold` in the end; odometry is known to be right.
    """
    graph = factors([*odometry, *loops])
    graph.add(first_held())
    known = [*range(len(odometry)), len(odometry) + len(loops)]
    parameters = gtsam.GncLMParams()
    parameters.setKnownInliers(known)  # slots of factors, not keys
    optimizer = gtsam.GncLMOptimizer(graph, values_of(start), parameters)
    optimizer.setInlierCostThresholds(threshold / 2)  # GTSAM's error is half the squared distance
    poses = poses_of(optimizer.optimize())
    return poses, np.asarray(optimizer.getWeights()[len(odometry) : -1]) > 0.5


def relative_covariances(edges: Sequence[Edge], poses: Array, pairs: Iterable[tuple[int, int]]) -> list[Array]:
    """(6, 6) of T_i_j in the axes of j for each pair (i, j), as the graph at its optimum `poses` (N, 4, 4) has it."""
    graph = factors(edges)
    graph.add(first_held())
    marginals, found = gtsam.Marginals(graph, values_of(poses)), []
    for i, j in pairs:
        joint = marginals.jointMarginalCovariance([i, j])
        Ad = adjoint(se3.inverse(poses[j]) @ poses[i])
        cross = Ad @ joint.at(i, j)
        found.append(np.asarray(joint.at(j, j) + Ad @ joint.at(i, i) @ Ad.T - cross - cross.T))
    return found


class Incremental:
    """Poses that follow each edge at once: iSAM2 (Kaess et al., IJRR 2012), with loops under a redescending kernel."""

    KERNEL = gtsam.noiseModel.mEstimator.GemanMcClure.Create(10.0)  # wide, so that true loops still pull

    def __init__(self, odometry: Sequence[Edge], loops: Sequence[Edge], poses: Array) -> None:
        parameters = gtsam.ISAM2Params()
        parameters.relinearizeSkip = 1
        self._isam = gtsam.ISAM2(parameters)
        graph = factors(odometry)
        graph.add(first_held())
        graph.push_back(factors(loops, self.KERNEL))
        self._isam.update(graph, values_of(poses))

    def add_odometry(self, edge: Edge) -> None:
        """The pose that the edge ends at joins."""
        guess = gtsam.Values()
        guess.insert(edge.j, self._isam.calculateEstimatePose3(edge.i).compose(gtsam.Pose3(edge.pose)))
        self._isam.update(factors([edge]), guess)

    def add_loop(self, edge: Edge) -> None:
        """Both its poses are there already."""
        self._isam.update(factors([edge], self.KERNEL), gtsam.Values())
        self._isam.update()  # the kernel's weight follows the poses

    def loop_weight(self, distance: float) -> float:
        """0 to 1, of a loop that is off by so many standard deviations."""
        return float(self.KERNEL.weight(distance))

    def poses(self) -> Array:
        """(N, 4, 4)"""
        return poses_of(self._isam.calculateEstimate())
