"""Interface to GTSAM with arrays of poses and edges: least squares, marginals, GNC and iSAM2.

This is the only file that imports gtsam. Pose k of an array has key k, and the first is fixed at the identity. Tangent
vectors and covariances have the rotation first, as in `pose_graph`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import gtsam
import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.pose_graph import Edge, adjoint, reversed_edge

FIRST_SIGMA = 1e-4  # rad, m: prior of the first pose at the identity
UNCHANGED = 0.01  # rad, m: a smaller correction of a pose is not propagated to the poses behind it, until `settle`
#: rad², m²: added to the covariances of all edges until the marginals can be computed
FLOORS = tuple(floor * np.diag([0.01] * 3 + [1.0] * 3) for floor in (0.0, 1e-7, 1e-6, 1e-5, 1e-4))
TOLERANCE = 1e-9  # relative error: with large covariances, GTSAM's default 1e-5 stops half a metre from the optimum


def factors(edges: Iterable[Edge], kernel: Any = None) -> Any:
    """Build a NonlinearFactorGraph with one factor per edge, in order; `kernel` is an m-estimator of GTSAM."""
    graph = gtsam.NonlinearFactorGraph()
    for edge in edges:
        gaussian = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        noise = gaussian if kernel is None else gtsam.noiseModel.Robust.Create(kernel, gaussian)
        graph.add(gtsam.BetweenFactorPose3(edge.i, edge.j, gtsam.Pose3(edge.pose), noise))
    return graph


def prior_of_first() -> Any:
    """Return the prior factor that fixes the first pose."""
    return gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, FIRST_SIGMA))


def values_of(poses: Array) -> Any:
    """Convert poses (N, 4, 4) into GTSAM's Values."""
    values = gtsam.Values()
    for key, pose in enumerate(poses):
        values.insert(key, gtsam.Pose3(pose))  # a bare array would be stored as a matrix
    return values


def poses_of(values: Any) -> Array:
    """Convert GTSAM's Values into poses (N, 4, 4)."""
    rows = np.asarray(gtsam.utilities.extractPose3(values))  # R row by row, then t
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = rows[:, :9].reshape(-1, 3, 3)
    poses[:, :3, 3] = rows[:, 9:]
    return poses


def squared_distances(edges: Sequence[Edge], poses: Array) -> Array:
    """Compute the squared Mahalanobis distance (E,) of each edge to poses (N, 4, 4), twice GTSAM's error."""
    graph, values = factors(edges), values_of(poses)
    return np.array([2 * graph.at(k).error(values) for k in range(len(edges))])


def optimised(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array) -> Array:
    """Optimise poses (N, 4, 4) by Levenberg-Marquardt from `start`; the first pose stays at the identity."""
    graph = factors([*odometry, *loops])
    graph.add(prior_of_first())
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(TOLERANCE)
    return poses_of(gtsam.LevenbergMarquardtOptimizer(graph, values_of(start), parameters).optimize())


def gnc(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array, threshold: float) -> tuple[Array, Array]:
    """Optimise poses and reject outlier loops by GNC-TLS (Yang et al., RA-L 2020).

    Args:
        odometry: Edges that are inliers.
        loops: Edges that may be outliers.
        start: Initial poses (N, 4, 4).
        threshold: Maximum squared Mahalanobis distance of an inlier.

    Returns:
        Poses (N, 4, 4), and (L,) bool, which loops are inliers.
    """
    graph = factors([*odometry, *loops])
    graph.add(prior_of_first())
    known = [*range(len(odometry)), len(odometry) + len(loops)]
    parameters = gtsam.GncLMParams()
    parameters.setKnownInliers(known)  # indices of factors, not keys
    optimizer = gtsam.GncLMOptimizer(graph, values_of(start), parameters)
    optimizer.setInlierCostThresholds(threshold / 2)  # GTSAM's error is half the squared distance
    poses = poses_of(optimizer.optimize())
    return poses, np.asarray(optimizer.getWeights()[len(odometry) : -1]) > 0.5


def relative_covariances(edges: Sequence[Edge], poses: Array, pairs: Iterable[tuple[int, int]]) -> list[Array]:
    """Compute the covariances (6, 6) of T_i_j, in the axes of j, for pairs (i, j) at the optimum `poses` (N, 4, 4)."""
    graph = factors(edges)
    graph.add(prior_of_first())
    marginals, found = gtsam.Marginals(graph, values_of(poses)), []
    for i, j in pairs:
        joint = marginals.jointMarginalCovariance([i, j])
        Ad = adjoint(se3.inverse(poses[j]) @ poses[i])
        cross = Ad @ joint.at(i, j)
        found.append(np.asarray(joint.at(j, j) + Ad @ joint.at(i, i) @ Ad.T - cross - cross.T))
    return found


def pose_covariances(edges: Sequence[Edge], poses: Array) -> tuple[Array, Array]:
    """Compute the marginal covariances of poses relative to the first one, which is exact.

    Args:
        edges: The edges, which connect all poses.
        poses: The optimum (N, 4, 4).

    Returns:
        Covariances (N, 6, 6) in the axes of each pose, zero for the first; and cross-covariances (N - 1, 6, 6) of each
        pose, in its axes, with the next one, in the axes of that one.
    """
    own, cross = np.zeros((len(poses), 6, 6)), np.zeros((len(poses) - 1, 6, 6))
    if len(poses) < 2:
        return own, cross
    marginals = _marginals(edges, poses)
    for key in range(1, len(poses)):
        own[key] = marginals.marginalCovariance(key)
    for key in range(1, len(poses) - 1):
        cross[key] = marginals.jointMarginalCovariance([key, key + 1]).at(key, key + 1)
    return own, cross


def _marginals(edges: Sequence[Edge], poses: Array) -> Any:
    """GTSAM's Marginals of poses 1, 2 .. given the first.

    Cholesky's method fails where edges of very different certainty meet; then all are made a little less certain.
    """
    for floor in FLOORS:
        raised = [replace(edge, covariance=edge.covariance + floor) for edge in edges]
        graph = factors(edge for edge in raised if 0 not in (edge.i, edge.j))
        from_first = [edge if edge.i == 0 else reversed_edge(edge) for edge in raised if 0 in (edge.i, edge.j)]
        for edge in from_first:  # a prior of weight 1 / FIRST_SIGMA² would add its own error, growing with the distance
            measured = gtsam.Pose3(poses[0] @ edge.pose)
            graph.add(gtsam.PriorFactorPose3(edge.j, measured, gtsam.noiseModel.Gaussian.Covariance(edge.covariance)))
        values = values_of(poses)
        values.erase(0)
        try:
            return gtsam.Marginals(graph, values)
        except RuntimeError as error:  # GTSAM's IndeterminateLinearSystemException
            failure = error
    raise failure


class Incremental:
    """Incremental optimisation by iSAM2 (Kaess et al., IJRR 2012), with a redescending kernel for loops.

    The equations are factorised by Cholesky's method, which takes half the time of QR. It fails where edges of very
    different certainty meet, as at a gap in the odometry; from the first failure on, QR takes its place.
    """

    KERNEL = gtsam.noiseModel.mEstimator.GemanMcClure.Create(10.0)  # wide, so that true loops keep their weight

    def __init__(self, odometry: Sequence[Edge], loops: Sequence[Edge], poses: Array) -> None:
        self._odometry, self._loops, self._method = list(odometry), list(loops), "CHOLESKY"
        self._begin(poses)

    def add_odometry(self, edges: Sequence[Edge]) -> None:
        """Add successive odometry edges, each with the pose where it ends."""
        if not edges:
            return
        guess, pose = gtsam.Values(), self._isam.calculateEstimatePose3(edges[0].i)
        for edge in edges:
            pose = pose.compose(gtsam.Pose3(edge.pose))
            guess.insert(edge.j, pose)
        self._odometry.extend(edges)
        self._update(factors(edges), guess)

    def add_loop(self, edge: Edge) -> None:
        """Add a loop edge between existing poses."""
        new = factors([edge], self.KERNEL)
        self._loops.append(edge)
        self._update(new, gtsam.Values())
        self._update(gtsam.NonlinearFactorGraph(), gtsam.Values())  # the kernel's weight, with the new poses

    @classmethod
    def loop_weight(cls, distance: float) -> float:
        """Return the weight, 0 to 1, of a loop at a Mahalanobis distance."""
        return float(cls.KERNEL.weight(distance))

    def poses(self) -> Array:
        """Return the current poses (N, 4, 4)."""
        return poses_of(self._isam.calculateEstimate())

    def _begin(self, poses: Array) -> None:
        """Start with all edges at poses (N, 4, 4)."""
        parameters = gtsam.ISAM2Params()
        parameters.relinearizeSkip = 1
        parameters.enablePartialRelinearizationCheck = True  # a check of all poses would take longer than the rest
        parameters.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(UNCHANGED))
        parameters.setFactorization(self._method)
        self._isam = gtsam.ISAM2(parameters)
        graph = factors(self._odometry)
        graph.add(prior_of_first())
        graph.push_back(factors(self._loops, self.KERNEL))
        self._update(graph, values_of(poses))

    def _update(self, new: Any, guess: Any) -> None:
        try:
            self._isam.update(new, guess)
        except RuntimeError as error:
            if self._method == "QR" or "ndetermin" not in str(error):
                raise
            self._method = "QR"
            self._begin(poses_of(self._isam.getLinearizationPoint()))  # within 0.1 m and rad of the estimate
