"""Which loops are true: graduated non-convexity on a reduced graph, then whatever lowers the same cost on the full one.

The cost is that of truncated least squares: the squared distances of all edges, a loop's at most the threshold.
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

ROUNDS = 5  # of solving the full graph and looking again which loops fit it
LEAST_GAIN = 1 / 3  # of the threshold: what is gained without a true loop that is merely inexact was below 1/5
TRIED = 5  # groups at most whose absence is tried in a round
DOUBTFUL = 0.25  # of the threshold: a loop that is off by half as many standard deviations as it may be


@dataclass(frozen=True, eq=False)
class Verdict:
    """`poses` (N, 4, 4) of the full graph with the accepted loops; for each loop whether it is true, (L,), and why."""

    poses: Array
    accepted: Array
    reasons: tuple[str, ...]


def judge(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array) -> Verdict:
    """Which loops are true, starting from poses (N, 4, 4); odometry is taken for sound. Deterministic.

    1. Loops that agree with neighbours are clustered; one of each cluster goes into a graph reduced to the poses that
       they touch, where GNC-TLS decides.
    2. Loops on their own are held against the result, its uncertainty included; those that may be true are decided
       together with the clusters, from there.
    3. The full graph is solved with all the loops that stay; loops that fit it, and only they, are accepted.
    4. A cluster that only just fits is left out for a trial: where the rest fits so much better, it stays out.
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

    stay = np.zeros(len(loops), bool)
    stay[[n for group in supported for n in group]] = True
    state = _settled(odometry, loops, stay, poses, threshold)
    state = _without_wrong(odometry, loops, groups, state, threshold)
    reasons = (
        f"{'fits' if stays else 'contradicts'} the graph: chi2 {value:.3g}, limit {threshold:.3g}"
        for stays, value in zip(state.accepted, state.distance, strict=True)
    )
    return Verdict(state.poses, state.accepted, tuple(reasons))


@dataclass(frozen=True, eq=False)
class _State:
    """The full graph solved with the accepted loops: squared distance of every loop (L,), and the truncated cost."""

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
    """Solved again until the accepted loops are those that fit: neither step raises the cost."""
    state = _solved(odometry, loops, accepted, start, threshold)
    for _ in range(ROUNDS - 1):
        fits = state.distance < threshold
        if (fits == state.accepted).all():
            break
        state = _solved(odometry, loops, fits, state.poses, threshold)
    return state


def _without_wrong(
    odometry: Sequence[Edge], loops: Sequence[Edge], groups: Groups, state: _State, threshold: float
) -> _State:
    """Without the groups, or the worst loops of groups, whose absence lowers the cost; the most helpful goes first.

    A wrong loop bends the graph until it fits, though only just, and GNC may end in such an optimum of the cost that is
    not the best one. Tried are the few groups with the most doubtful loops.
    """
    for _ in range(ROUNDS):
        worst = [max(group, key=lambda n: state.accepted[n] * state.distance[n]) for group in groups]
        doubt = state.accepted[worst] * state.distance[worst]
        doubtful = [k for k in np.argsort(-doubt, kind="stable")[:TRIED] if doubt[k] > DOUBTFUL * threshold]
        best = state
        for suspects in {tuple(some): None for k in doubtful for some in (groups[k], [worst[k]])}:
            rest = state.accepted.copy()
            rest[list(suspects)] = False
            trial = _solved(odometry, loops, rest, state.poses, threshold)
            best = min(best, trial, key=lambda one: one.cost)
        if state.cost - best.cost < LEAST_GAIN * threshold:
            break
        state = _settled(odometry, loops, best.distance < threshold, best.poses, threshold)
    return state


def _decided(
    odometry: Sequence[Edge], loops: Sequence[Edge], groups: Groups, start: Array, threshold: float
) -> tuple[Array, Groups]:
    """Poses (N, 4, 4) and the groups that stay, by GNC on the reduced graph.

    The middle loop of each group stands for all of them: it counts as often as the group has loops.
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
    """Those of the groups whose middle loop would raise the cost of the trusted graph by less than `threshold`.

    To first order that is its squared Mahalanobis distance with the uncertainty of the graph included.
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
