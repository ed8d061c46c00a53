"""The pose graph in GTSAM: iSAM2 while driving, and graduated non-convexity to judge the loops all together.

The only file that imports gtsam. Edges and covariances are as in `pose_graph`: rotation first, as Pose3 has them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gtsam
import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.clusters import LoopClusters
from slam.graph.ledger import LoopCandidate, LoopRecord, Status
from slam.graph.pose_graph import Edge, PoseGraph, adjoint, disagreement, odometry_poses, reduced

Groups = list[list[int]]

FIRST_SIGMA = 1e-4  # rad, m: how firmly the first pose is held at the identity
KERNEL = gtsam.noiseModel.mEstimator.GemanMcClure.Create(10.0)  # of loops in iSAM2: wide, so that true ones still pull
ROUNDS = 5  # of solving the full graph and looking again which loops fit it


class BackEnd:
    """Poses from odometry and loops. Pose 0 is the identity; each odometry edge adds the next one.

    Updates are incremental (iSAM2: Kaess et al., IJRR 2012), loops under a redescending kernel. `settle` judges all
    loops together and solves the whole graph; call it at bursts of loops and at the end.
    """

    def __init__(self) -> None:
        self.odometry: list[Edge] = []
        self._loops: list[tuple[int, Edge]] = []  # the record of each in the ledger, and what was measured
        self._records: list[LoopRecord] = []
        self._judged = 0  # loops that the last batch solution has seen
        self._settled = np.eye(4)[None]  # poses by the last batch solution
        self._isam = _isam([], np.eye(4)[None])

    def __len__(self) -> int:
        return len(self.odometry) + 1

    def add_odometry(self, pose: Array, covariance: Array) -> int:
        """The next pose, by its T_i_j (4, 4) from the last one and the covariance (6, 6) of that. Returns its index.

        Raises ValueError where the covariance is not positive definite or a number is not finite.
        """
        edge = Edge(len(self) - 1, len(self), pose, covariance)
        guess = gtsam.Values()
        guess.insert(edge.j, self._isam.calculateEstimatePose3(edge.i).compose(gtsam.Pose3(pose)))
        self._isam.update(_graph([edge]), guess)
        self.odometry.append(edge)
        return edge.j

    def add_loop(self, candidate: LoopCandidate, covariance: Array) -> None:
        """A verified loop, with the covariance (6, 6) of its pose. Raises ValueError as `add_odometry` does."""
        edge = Edge(candidate.i, candidate.j, candidate.pose, covariance)
        if not (0 <= edge.i < len(self) and 0 <= edge.j < len(self)):
            raise ValueError(f"loop {edge.i} -> {edge.j}: there are only poses 0 to {len(self) - 1}")
        self._isam.update(_graph([edge], KERNEL), gtsam.Values())
        self._isam.update()  # the kernel's weight follows the poses
        self._loops.append((len(self._records), edge))
        self._records.append(LoopRecord(candidate, 0.0, "accepted", "verified"))

    def reject(self, candidate: LoopCandidate, reason: str) -> None:
        """A candidate that its verification refused: it goes into the ledger alone."""
        self._records.append(LoopRecord(candidate, 0.0, "rejected", reason))

    def pose(self, i: int) -> Array:
        """T_world_i (4, 4) by all edges so far."""
        return np.ascontiguousarray(self._isam.calculateEstimatePose3(i).matrix())

    def poses(self) -> Array:
        """All T_world_i (N, 4, 4) by all edges so far."""
        return _poses(self._isam.calculateEstimate())

    def marginal_covariance(self, i: int) -> Array:
        """(6, 6) of pose @ exp(xi), given the first pose."""
        return np.ascontiguousarray(self._isam.marginalCovariance(i))

    def settle(self) -> None:
        """Judge all loops together, solve the full graph with those that stay, and go on from there."""
        since = odometry_poses(self.odometry[len(self._settled) - 1 :], self._settled[-1])
        start = np.concatenate([self._settled, since[1:]])
        loops = [edge for _, edge in self._loops]
        verdict = judge(self.odometry, loops, start)
        for (record, _), accepted, reason in zip(self._loops, verdict.accepted, verdict.reasons, strict=True):
            before = self._records[record]
            status: Status = "accepted" if accepted else "rejected"
            self._records[record] = replace(before, weight=float(accepted), status=status, reason=reason)
        self._settled, self._judged = verdict.poses, len(loops)
        kept = [edge for edge, accepted in zip(loops, verdict.accepted, strict=True) if accepted]
        self._isam = _isam(self.odometry, verdict.poses, kept)

    def ledger(self) -> list[LoopRecord]:
        """Every candidate and its fate, as they came. A loop that `settle` has not seen has its weight in iSAM2."""
        records, poses = list(self._records), self.poses()
        for record, edge in self._loops[self._judged :]:
            weight = float(KERNEL.weight(float(np.sqrt(disagreement(edge, poses)))))
            records[record] = replace(records[record], weight=weight)
        return records

    def graph(self) -> PoseGraph:
        """The poses, the odometry and the accepted loops, as g2o takes them."""
        accepted = [edge for record, edge in self._loops if self._records[record].status == "accepted"]
        return PoseGraph(self.poses(), (*self.odometry, *accepted))


@dataclass(frozen=True, eq=False)
class Verdict:
    """`poses` (N, 4, 4) of the full graph with the accepted loops; for each loop whether it is true, (L,), and why."""

    poses: Array
    accepted: Array
    reasons: tuple[str, ...]


def judge(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array) -> Verdict:
    """Which loops are true, starting from poses (N, 4, 4); odometry is taken for sound. Deterministic.

    1. Loops that agree with neighbours are clustered; one of each cluster goes into a graph reduced to the poses that
       they touch, where graduated non-convexity with truncated least squares (GNC-TLS: Yang et al., RA-L 2020) decides.
    2. Loops on their own are held against the result, its uncertainty included; those that may be true are decided
       together with the clusters, from there.
    3. The full graph is solved with all the loops that stay; loops that fit it, and only they, are in the end accepted.
    """
    if not loops:
        return Verdict(optimised(odometry, [], start), np.zeros(0, bool), ())
    clusters = LoopClusters(loops, odometry)
    groups, threshold = clusters.groups(), clusters.threshold
    together = [group for group in groups if len(group) > 1]
    possible = [group for group in groups if len(group) == 1]
    poses, supported = _decided(odometry, loops, together, start, threshold)
    middles, members = [_middle(loops, group) for group in supported], [loops[n] for group in supported for n in group]
    for trusted in (middles, members):  # the few cheap ones refuse most
        possible = _possible(odometry, loops, possible, trusted, poses, threshold)
    if possible:
        poses, supported = _decided(odometry, loops, supported + possible, poses, threshold)

    fits = np.zeros(len(loops), bool)
    fits[[n for group in supported for n in group]] = True
    for _ in range(ROUNDS):
        accepted = fits
        poses = optimised(odometry, [loop for loop, stays in zip(loops, accepted, strict=True) if stays], poses)
        distance = np.array([disagreement(loop, poses) for loop in loops])
        fits = distance < threshold
        if (fits == accepted).all():
            break
    reasons = (
        f"{'fits' if stays else 'contradicts'} the graph: chi2 {value:.3g}, limit {threshold:.3g}"
        for stays, value in zip(accepted, distance, strict=True)
    )
    return Verdict(poses, accepted, tuple(reasons))


def optimised(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array) -> Array:
    """Poses (N, 4, 4) that fit all edges best, by Levenberg-Marquardt from `start`; the first stays the identity."""
    graph = _graph([*odometry, *loops], first=0)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(
        1e-9
    )  # where much noise is stated, GTSAM's 1e-5 is half a metre short of the optimum
    return _poses(gtsam.LevenbergMarquardtOptimizer(graph, _values(range(len(start)), start), parameters).optimize())


def gnc(odometry: Sequence[Edge], loops: Sequence[Edge], start: Any, threshold: float) -> tuple[Any, Array]:
    """Values, and (L,) bool: the loops that GNC-TLS keeps, those within the squared distance `threshold` in the end."""
    graph = _graph([*odometry, *loops], first=min(start.keys()))
    known = len(odometry) + 1
    parameters = gtsam.GncLMParams()
    parameters.setKnownInliers(list(range(known)))  # slots of factors, not keys
    optimizer = gtsam.GncLMOptimizer(graph, start, parameters)
    optimizer.setInlierCostThresholds(threshold / 2)  # GTSAM's error is half the squared distance
    return optimizer.optimize(), np.asarray(optimizer.getWeights()[known:]) > 0.5


def _decided(
    odometry: Sequence[Edge], loops: Sequence[Edge], groups: Groups, start: Array, threshold: float
) -> tuple[Array, Groups]:
    """Poses (N, 4, 4) and the groups that stay, by GNC on the reduced graph.

    The middle loop of each group stands for all of them: it counts as often as the group has loops.
    """
    if not groups:
        return start, groups
    sizes = [len(group) for group in groups]
    chosen = [loop for group, size in zip(groups, sizes, strict=True) for loop in [_middle(loops, group)] * size]
    touched, chain = reduced(odometry, chosen)
    values, kept = gnc(chain, chosen, _values(touched, start[touched]), threshold)
    moved = _poses(values) @ se3.inverse(start[touched])
    last_touched = np.searchsorted(touched, np.arange(len(start)), side="right") - 1
    firsts = np.cumsum([0, *sizes[:-1]])
    return moved[last_touched] @ start, [group for group, stays in zip(groups, kept[firsts], strict=True) if stays]


def _possible(
    odometry: Sequence[Edge],
    loops: Sequence[Edge],
    groups: Groups,
    trusted: Sequence[Edge],
    start: Array,
    threshold: float,
) -> Groups:
    """Those of the groups whose middle loop would raise the cost of the trusted graph by less than `threshold`.

    To first order that is its squared Mahalanobis distance with the uncertainty of the graph included.
    """
    if not groups:
        return []
    tested = [_middle(loops, group) for group in groups]
    touched, chain = reduced(odometry, [*trusted, *tested])
    graph = _graph([*chain, *trusted], first=0)
    values = gtsam.LevenbergMarquardtOptimizer(graph, _values(touched, start[touched])).optimize()
    marginals = gtsam.Marginals(graph, values)
    poses = np.array(start)
    poses[touched] = _poses(values)
    misfits = (disagreement(loop, poses, _relative_covariance(marginals, loop, poses)) for loop in tested)
    return [group for group, misfit in zip(groups, misfits, strict=True) if misfit < threshold]


def _middle(loops: Sequence[Edge], group: list[int]) -> Edge:
    return loops[group[len(group) // 2]]


def _relative_covariance(marginals: Any, loop: Edge, poses: Array) -> Array:
    """(6, 6) of T_i_j as the graph has it, in the axes of j, from the joint covariance of the two poses."""
    i, j = loop.i, loop.j
    joint = marginals.jointMarginalCovariance([i, j])
    Ad = adjoint(se3.inverse(poses[j]) @ poses[i])
    cross = Ad @ joint.at(i, j)
    return np.asarray(joint.at(j, j) + Ad @ joint.at(i, i) @ Ad.T - cross - cross.T)


def _isam(edges: Sequence[Edge], poses: Array, loops: Sequence[Edge] = ()) -> Any:
    parameters = gtsam.ISAM2Params()
    parameters.relinearizeSkip = 1
    isam = gtsam.ISAM2(parameters)
    graph = _graph(edges, first=0)
    graph.push_back(_graph(loops, KERNEL))
    isam.update(graph, _values(range(len(poses)), poses))
    return isam


def _graph(edges: Sequence[Edge], kernel: Any = None, first: int | None = None) -> Any:
    """The factors of edges, after that which holds pose `first` at the identity, where one is named."""
    graph = gtsam.NonlinearFactorGraph()
    if first is not None:
        firmly = gtsam.noiseModel.Isotropic.Sigma(6, FIRST_SIGMA)
        graph.add(gtsam.PriorFactorPose3(first, gtsam.Pose3(), firmly))
    for edge in edges:
        gaussian = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        noise = gaussian if kernel is None else gtsam.noiseModel.Robust.Create(kernel, gaussian)
        graph.add(gtsam.BetweenFactorPose3(edge.i, edge.j, gtsam.Pose3(edge.pose), noise))
    return graph


def _values(keys: Iterable[int], poses: Array) -> Any:
    values = gtsam.Values()
    for key, pose in zip(keys, poses, strict=True):
        values.insert(key, gtsam.Pose3(pose))  # a bare array would be stored as a matrix
    return values


def _poses(values: Any) -> Array:
    """All poses (N, 4, 4), by rising key."""
    rows = np.asarray(gtsam.utilities.extractPose3(values))  # R row by row, then t
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = rows[:, :9].reshape(-1, 3, 3)
    poses[:, :3, 3] = rows[:, 9:]
    return poses
