"""Back end: incremental pose graph, joint selection of loops, and a record of every loop candidate."""

from __future__ import annotations

from collections.abc import Container, Sequence
from copy import deepcopy
from itertools import chain

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.chain import Chain
from slam.graph.ledger import Ledger, LoopCandidate, LoopRecord
from slam.graph.loop_selection import select_loops
from slam.graph.pose_graph import Edge, Edges, PoseGraph, disagreement, odometry_poses
from slam.graph.solver import Incremental


class BackEnd:
    """Poses from odometry and loops. Pose 0 is the identity; each odometry edge adds the next pose.

    Updates are incremental. `settle` selects the consistent loops jointly and solves the full graph; call it after many
    new loops and at the end.

    Poses at known places (`add_known`) are not solved for: their loops give them, relative to an earlier pose. Only the
    last one of a stretch of such poses is part of the graph, since it ties what comes next to the place. So the graph
    does not grow while the sensor is where it has been often.

    Attributes:
        odometry: The odometry edges.
        known: The number in the ledger of the loop of each pose at a known place that is not solved for, by the pose.
    """

    def __init__(self) -> None:
        self.odometry = Edges()
        self.known: dict[int, int] = {}
        self._last_known: tuple[int, Edge] | None = None  # as in `_loops`; part of the graph, unless the next is known
        self._loops: list[tuple[int, Edge]] = []  # index of the record in the ledger, and the edge
        self._ledger = Ledger()
        self._chain = Chain()
        self._selected = 0  # number of loops in the last batch solution
        self._settled = np.eye(4)[None]  # poses of the last batch solution
        self._online: Incremental | None = Incremental(
            [], [], np.eye(4)[None]
        )  # None: while an earlier session is read

    def __len__(self) -> int:
        return len(self.odometry) + 1

    def add_odometry(self, pose: Array, covariance: Array) -> int:
        """Add the next pose, by its T_i_j (4, 4) from the last one and the covariance (6, 6); return its index.

        Raises:
            ValueError: The covariance is not positive definite, or a number is not finite.
        """
        edge = Edge(len(self) - 1, len(self), pose, covariance)
        self.odometry.append(edge)  # and part of the graph with the next loop
        return edge.j

    def add_loop(self, candidate: LoopCandidate, covariance: Array) -> None:
        """Add a verified loop with the covariance (6, 6) of its pose.

        Raises:
            ValueError: A pose does not exist, or as `add_odometry`.
        """
        record, edge = self._recorded(candidate, covariance)
        self._extend(max(edge.i, edge.j))
        self._close(record, edge)

    def add_known(self, candidate: LoopCandidate, covariance: Array) -> None:
        """Add a verified loop of pose j, which is at a known place; poses up to j and their loops were added before.

        Args:
            candidate: The loop; its pose i is not at a known place itself.
            covariance: (6, 6) covariance of its pose.

        Raises:
            ValueError: As `add_loop`.
        """
        if candidate.j < len(self._chain) or (self._last_known and candidate.j <= self._last_known[1].j):
            raise ValueError(f"loop {candidate.i} -> {candidate.j}: its pose is part of the graph already")
        record, edge = self._recorded(candidate, covariance)
        if self._last_known and self._last_known[1].j == edge.j - 1:
            number, before = self._last_known
            self.known[before.j] = number
            self._ledger.decide(number, 1.0, "accepted", "known place")
        elif self._last_known:
            self._extend(self._last_known[1].j)
        self._extend(edge.i)
        self._last_known = record, edge

    def reject(self, candidate: LoopCandidate, reason: str) -> None:
        """Record a candidate that the verification rejected; it is not added to the graph."""
        self._ledger.append(LoopRecord(candidate, 0.0, "rejected", reason), None)

    def restore(
        self,
        odometry: Sequence[Edge],
        loops: Sequence[tuple[LoopCandidate, Array | None, str]],
        known: Container[int] = (),
    ) -> None:
        """Add the edges and candidates of an earlier session at once.

        The poses before `settle` are those of another order of updates, so they differ by rounding from those of the
        session; the results of `settle` do not.

        Args:
            odometry: All odometry edges.
            loops: The candidates, each with the covariance (6, 6) of its pose, or None and the reason of the rejection.
            known: The poses at known places.

        Raises:
            ValueError: As `add_odometry` and `add_loop`.
        """
        for number, edge in enumerate(odometry):
            if (edge.i, edge.j) != (number, number + 1):
                raise ValueError(f"odometry edge {edge.i} -> {edge.j} in place of {number} -> {number + 1}")
        self.odometry, self._online = Edges(odometry), None
        for candidate, covariance, reason in loops:
            if covariance is None:
                self.reject(candidate, reason)
            elif candidate.j in known:
                self.add_known(candidate, covariance)
            else:
                self.add_loop(candidate, covariance)
        edges = [self._chain.renamed(edge) for _, edge in self._loops]
        self._online = Incremental(self._chain.edges, edges, odometry_poses(self._chain.edges, np.eye(4)))

    @property
    def has_loops(self) -> bool:
        """Whether any loop is accepted."""
        return any(self._ledger[record].status == "accepted" for record, _ in self._loops)

    def poses(self) -> Array:
        """Return all poses T_world_i (N, 4, 4) from all edges so far."""
        assert self._online is not None
        solved, poses = self._chain.nodes, np.tile(np.eye(4), (len(self), 1, 1))
        poses[solved] = self._online.poses()
        given = self.known | ({self._last_known[1].j: self._last_known[0]} if self._last_known else {})
        for record in given.values():
            loop = self._ledger[record].candidate
            poses[loop.j] = poses[loop.i] @ loop.pose
        for edge in self.odometry[solved[-1] :]:  # not part of the graph yet
            if edge.j not in given:
                poses[edge.j] = se3.normalized(poses[edge.i] @ edge.pose)
        return poses

    def settle(self) -> None:
        """Select the consistent loops jointly, solve the full graph with them, and continue from its solution."""
        self._extend(len(self) - 1)
        odometry, loops = self._chain.edges, [self._chain.renamed(edge) for _, edge in self._loops]
        since = odometry_poses(odometry[len(self._settled) - 1 :], self._settled[-1])
        selection = select_loops(odometry, loops, np.concatenate([self._settled, since[1:]]))
        for (record, _), accepted, reason in zip(self._loops, selection.accepted, selection.reasons, strict=True):
            self._ledger.decide(record, float(accepted), "accepted" if accepted else "rejected", reason)
        self._settled, self._selected = selection.poses, len(loops)
        kept = [edge for edge, accepted in zip(loops, selection.accepted, strict=True) if accepted]
        self._online = Incremental(odometry, kept, selection.poses)

    def ledger(self) -> Ledger:
        """Return the records of all candidates in order; loops added after `settle` have their online weight."""
        ledger, poses = deepcopy(self._ledger), self.poses()
        for record, edge in self._loops[self._selected :]:
            weight = Incremental.loop_weight(float(np.sqrt(disagreement(edge, poses))))
            ledger.decide(record, weight, ledger[record].status, ledger[record].reason)
        return ledger

    def graph(self) -> PoseGraph:
        """Return the pose graph of all poses, the odometry and the accepted loops, also those of known places."""
        accepted = (edge for record, edge in self._loops if self._ledger[record].status == "accepted")
        known = (self._ledger.edge(record) for record in self.known.values())
        return PoseGraph(self.poses(), Edges(chain(self.odometry, accepted, known)))

    def _recorded(self, candidate: LoopCandidate, covariance: Array) -> tuple[int, Edge]:
        """The number of the new record of a verified loop, and its edge."""
        edge = Edge(candidate.i, candidate.j, candidate.pose, covariance)
        if not (0 <= edge.i < len(self) and 0 <= edge.j < len(self)):
            raise ValueError(f"loop {edge.i} -> {edge.j}: poses 0 to {len(self) - 1} exist")
        if self._left_out(edge.i) or edge.j in self.known:
            raise ValueError(f"loop {edge.i} -> {edge.j}: joins a pose at a known place")
        return self._ledger.append(LoopRecord(candidate, 0.0, "accepted", "verified"), covariance), edge

    def _left_out(self, pose: int) -> bool:
        """Whether a pose is at a known place and not part of the graph."""
        return pose in self.known or (self._last_known is not None and pose == self._last_known[1].j)

    def _extend(self, last: int) -> None:
        """Make the poses up to `last` part of the graph, without those of known places."""
        begin = len(self._chain.edges)
        for edge in self.odometry[len(self._chain) - 1 : last]:
            self._chain.add(edge, skip=edge.j in self.known)
        if self._online:
            self._online.add_odometry(self._chain.edges[begin:])
        if self._last_known and self._last_known[1].j <= last:
            loop, self._last_known = self._last_known, None
            self._close(*loop)

    def _close(self, record: int, edge: Edge) -> None:
        """Make a loop part of the graph."""
        self._loops.append((record, edge))
        if self._online:
            self._online.add_loop(self._chain.renamed(edge))
