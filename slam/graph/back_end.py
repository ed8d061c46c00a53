"""Back end: incremental pose graph, joint selection of loops, and a record of every loop candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slam.data.cloud import Array
from slam.graph.ledger import LoopCandidate, LoopRecord, Status
from slam.graph.loop_selection import select_loops
from slam.graph.pose_graph import Edge, PoseGraph, disagreement, odometry_poses
from slam.graph.solver import Incremental


class BackEnd:
    """Poses from odometry and loops. Pose 0 is the identity; each odometry edge adds the next pose.

    Updates are incremental. `settle` selects the consistent loops jointly and solves the full graph; call it after many
    new loops and at the end.

    Attributes:
        odometry: The odometry edges.
    """

    def __init__(self) -> None:
        self.odometry: list[Edge] = []
        self._loops: list[tuple[int, Edge]] = []  # index of the record in the ledger, and the edge
        self._records: list[LoopRecord] = []
        self._selected = 0  # number of loops in the last batch solution
        self._settled = np.eye(4)[None]  # poses of the last batch solution
        self._online = Incremental([], [], np.eye(4)[None])

    def __len__(self) -> int:
        return len(self.odometry) + 1

    def add_odometry(self, pose: Array, covariance: Array) -> int:
        """Add the next pose, by its T_i_j (4, 4) from the last one and the covariance (6, 6); return its index.

        Raises:
            ValueError: The covariance is not positive definite, or a number is not finite.
        """
        edge = Edge(len(self) - 1, len(self), pose, covariance)
        self._online.add_odometry(edge)
        self.odometry.append(edge)
        return edge.j

    def add_loop(self, candidate: LoopCandidate, covariance: Array) -> None:
        """Add a verified loop with the covariance (6, 6) of its pose.

        Raises:
            ValueError: A pose does not exist, or as `add_odometry`.
        """
        self._online.add_loop(self._keep_loop(candidate, covariance))

    def _keep_loop(self, candidate: LoopCandidate, covariance: Array) -> Edge:
        """Record a verified loop; return its edge."""
        edge = Edge(candidate.i, candidate.j, candidate.pose, covariance)
        if not (0 <= edge.i < len(self) and 0 <= edge.j < len(self)):
            raise ValueError(f"loop {edge.i} -> {edge.j}: poses 0 to {len(self) - 1} exist")
        self._loops.append((len(self._records), edge))
        self._records.append(LoopRecord(candidate, 0.0, "accepted", "verified"))
        return edge

    def reject(self, candidate: LoopCandidate, reason: str) -> None:
        """Record a candidate that the verification rejected; it is not added to the graph."""
        self._records.append(LoopRecord(candidate, 0.0, "rejected", reason))

    def restore(self, odometry: Sequence[Edge], loops: Sequence[tuple[LoopCandidate, Array | None, str]]) -> None:
        """Add the edges and candidates of an earlier session at once.

        The poses before `settle` are those of another order of updates, so they differ by rounding from those of the
        session; the results of `settle` do not.

        Args:
            odometry: All odometry edges.
            loops: The candidates, each with the covariance (6, 6) of its pose, or None and the reason of the rejection.

        Raises:
            ValueError: As `add_odometry` and `add_loop`.
        """
        for number, edge in enumerate(odometry):
            if (edge.i, edge.j) != (number, number + 1):
                raise ValueError(f"odometry edge {edge.i} -> {edge.j} in place of {number} -> {number + 1}")
        self.odometry = list(odometry)
        for candidate, covariance, reason in loops:
            if covariance is None:
                self.reject(candidate, reason)
            else:
                self._keep_loop(candidate, covariance)
        edges = [edge for _, edge in self._loops]
        self._online = Incremental(self.odometry, edges, odometry_poses(self.odometry, np.eye(4)))

    @property
    def has_loops(self) -> bool:
        """Whether any loop is accepted."""
        return any(self._records[record].status == "accepted" for record, _ in self._loops)

    def poses(self) -> Array:
        """Return all poses T_world_i (N, 4, 4) from all edges so far."""
        return self._online.poses()

    def settle(self) -> None:
        """Select the consistent loops jointly, solve the full graph with them, and continue from its solution."""
        since = odometry_poses(self.odometry[len(self._settled) - 1 :], self._settled[-1])
        start = np.concatenate([self._settled, since[1:]])
        loops = [edge for _, edge in self._loops]
        selection = select_loops(self.odometry, loops, start)
        for (record, _), accepted, reason in zip(self._loops, selection.accepted, selection.reasons, strict=True):
            before = self._records[record]
            status: Status = "accepted" if accepted else "rejected"
            self._records[record] = replace(before, weight=float(accepted), status=status, reason=reason)
        self._settled, self._selected = selection.poses, len(loops)
        kept = [edge for edge, accepted in zip(loops, selection.accepted, strict=True) if accepted]
        self._online = Incremental(self.odometry, kept, selection.poses)

    def ledger(self) -> list[LoopRecord]:
        """Return the records of all candidates in order; loops added after `settle` have their online weight."""
        records, poses = list(self._records), self.poses()
        for record, edge in self._loops[self._selected :]:
            weight = self._online.loop_weight(float(np.sqrt(disagreement(edge, poses))))
            records[record] = replace(records[record], weight=weight)
        return records

    def graph(self) -> PoseGraph:
        """Return the pose graph of all poses, the odometry and the accepted loops."""
        accepted = [edge for record, edge in self._loops if self._records[record].status == "accepted"]
        return PoseGraph(self.poses(), (*self.odometry, *accepted))
