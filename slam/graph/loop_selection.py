"""Robust selection of loops: graduated non-convexity on a reduced graph, then descent of the cost on the full graph.

The cost is truncated least squares: the sum of squared distances of all edges, where a loop adds at most the threshold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.clusters import LoopClusters
from slam.graph.pose_graph import Edge, disagreement, reduced
from slam.graph.solver import gnc, optimised, relative_covariances, squared_distances

Groups = list[list[int]]

MAX_ROUNDS = 5  # of solving the full graph and selecting the loops that fit it
MIN_GAIN = 1 / 3  # share of the threshold: removing a true but inexact loop gained less than 1/5
MAX_TRIALS = 5  # groups whose removal is tried per round
SUSPICIOUS = 0.25  # share of the threshold, in squared distance: half of the allowed standard deviations


@dataclass(frozen=True, eq=False)
class LoopSelection:
    """Result of `select_loops`.

    Attributes:
        poses: (N, 4, 4), solution of the full graph with the accepted loops.
        accepted: (L,) bool.
        reasons: Reason of each decision, L sentences.
    """

    poses: Array
    accepted: Array
    reasons: tuple[str, ...]


def select_loops(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array) -> LoopSelection:
    """Select the true loops, assuming that odometry has no outliers. Deterministic.

    1. Loops that agree with neighbours are clustered; one loop of each cluster goes into a graph reduced to the poses
       of these loops, where GNC-TLS decides.
    2. Single loops are tested against the result with its uncertainty; those that may be true are decided together with
       the clusters, starting from that result.
    3. The full graph is solved with the remaining loops; exactly the loops that fit it are accepted.
    4. Clusters that barely fit are removed on trial: if the cost decreases enough, they stay out.

    Args:
        odometry: Edge k joins pose k to k + 1.
        loops: Loop edges.
        start: Initial poses (N, 4, 4).
    """
    if not loops:
        return LoopSelection(optimised(odometry, [], start), np.zeros(0, bool), ())
    clusters = LoopClusters(loops, odometry)
    groups, threshold = clusters.groups(), clusters.threshold
    together = [group for group in groups if len(group) > 1]
    possible = [group for group in groups if len(group) == 1]
    poses, supported = _decided(odometry, loops, together, start, threshold)
    middles, members = [_middle(loops, group) for group in supported], [loops[n] for group in supported for n in group]
    for trusted in (middles, members):  # the first test is cheap and rejects most
        possible = _possible(odometry, loops, possible, trusted, poses, threshold)
    if possible:
        poses, supported = _decided(odometry, loops, supported + possible, poses, threshold)

    stay = np.zeros(len(loops), bool)
    stay[[n for group in supported for n in group]] = True
    state = _settled(odometry, loops, stay, poses, threshold)
    state = _without_wrong(odometry, loops, groups, state, threshold)
    reasons = (
        f"{'fits' if stays else 'contradicts'} the graph: chi2 {value:.3g}, limit {threshold:.3g}"
        for stays, value in zip(state.accepted, state.distance, strict=True)
    )
    return LoopSelection(state.poses, state.accepted, tuple(reasons))


@dataclass(frozen=True, eq=False)
class _State:
    """Solution of the full graph with the accepted loops: squared distances of all loops (L,), truncated cost."""

    poses: Array
    accepted: Array
    distance: Array
    cost: float


def _solved(odometry: Sequence[Edge], loops: Sequence[Edge], accepted: Array, start: Array, threshold: float) -> _State:
    poses = optimised(odometry, [loop for loop, stays in zip(loops, accepted, strict=True) if stays], start)
    distance = squared_distances(loops, poses)
    cost = squared_distances(odometry, poses).sum() + np.minimum(distance, threshold).sum()
    return _State(poses, accepted, distance, float(cost))


def _settled(
    odometry: Sequence[Edge], loops: Sequence[Edge], accepted: Array, start: Array, threshold: float
) -> _State:
    """Solve and reselect until the accepted loops are those that fit; neither step increases the cost."""
    state = _solved(odometry, loops, accepted, start, threshold)
    for _ in range(MAX_ROUNDS - 1):
        fits = state.distance < threshold
        if (fits == state.accepted).all():
            break
        state = _solved(odometry, loops, fits, state.poses, threshold)
    return state


def _without_wrong(
    odometry: Sequence[Edge], loops: Sequence[Edge], groups: Groups, state: _State, threshold: float
) -> _State:
    """Remove groups, or the worst loop of a group, as long as this decreases the cost; the best removal goes first.

    A false loop bends the graph until it barely fits, and GNC may end in such a local optimum. Only the groups with the
    largest squared distances are tried.
    """
    for _ in range(MAX_ROUNDS):
        worst = [max(group, key=lambda n: state.accepted[n] * state.distance[n]) for group in groups]
        distance = state.accepted[worst] * state.distance[worst]
        order = np.argsort(-distance, kind="stable")[:MAX_TRIALS]
        suspicious = [k for k in order if distance[k] > SUSPICIOUS * threshold]
        best = state
        for suspects in {tuple(some): None for k in suspicious for some in (groups[k], [worst[k]])}:
            rest = state.accepted.copy()
            rest[list(suspects)] = False
            trial = _solved(odometry, loops, rest, state.poses, threshold)
            best = min(best, trial, key=lambda one: one.cost)
        if state.cost - best.cost < MIN_GAIN * threshold:
            break
        state = _settled(odometry, loops, best.distance < threshold, best.poses, threshold)
    return state


def _decided(
    odometry: Sequence[Edge], loops: Sequence[Edge], groups: Groups, start: Array, threshold: float
) -> tuple[Array, Groups]:
    """Poses (N, 4, 4) and the groups that GNC keeps on the reduced graph.

    The middle loop of each group represents all of them: it is added as often as the group has loops.
    """
    if not groups:
        return start, groups
    sizes = [len(group) for group in groups]
    middles = [_middle(loops, group) for group in groups]
    touched, chain, middles = reduced(odometry, middles)
    chosen = [middle for middle, size in zip(middles, sizes, strict=True) for _ in range(size)]
    poses, kept = gnc(chain, chosen, start[touched], threshold)
    moved = poses @ se3.inverse(start[touched])
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
    """The groups whose middle loop would increase the cost of the trusted graph by less than `threshold`.

    To first order, this increase is the squared Mahalanobis distance including the uncertainty of the graph.
    """
    if not groups:
        return []
    touched, chain, edges = reduced(odometry, [*trusted, *(_middle(loops, group) for group in groups)])
    trusted, tested = edges[: len(trusted)], edges[len(trusted) :]
    poses = optimised(chain, trusted, start[touched])
    covariances = relative_covariances([*chain, *trusted], poses, ((loop.i, loop.j) for loop in tested))
    misfits = (disagreement(loop, poses, P) for loop, P in zip(tested, covariances, strict=True))
    return [group for group, misfit in zip(groups, misfits, strict=True) if misfit < threshold]


def _middle(loops: Sequence[Edge], group: list[int]) -> Edge:
    return loops[group[len(group) // 2]]
