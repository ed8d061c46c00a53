"""The pose graph of a drive: poses at once, loops judged all together, and the account of every candidate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slam.data.cloud import Array
from slam.graph.judge import judge
from slam.graph.ledger import LoopCandidate, LoopRecord, Status
from slam.graph.pose_graph import Edge, PoseGraph, disagreement, odometry_poses
from slam.graph.solver import Incremental


class BackEnd:
    """Poses from odometry and loops. Pose 0 is the identity; each odometry edge adds the next one.

    Updates are incremental. `settle` judges all loops together and solves the whole graph; call it at bursts of loops
    and at the end.
    """

    def __init__(self) -> None:
        self.odometry: list[Edge] = []
        self._loops: list[tuple[int, Edge]] = []  # the record of each in the ledger, and what was measured
        self._records: list[LoopRecord] = []
        self._judged = 0  # loops that the last batch solution has seen
        self._settled = np.eye(4)[None]  # poses by the last batch solution
        self._online = Incremental([], [], np.eye(4)[None])

    def __len__(self) -> int:
        return len(self.odometry) + 1

    def add_odometry(self, pose: Array, covariance: Array) -> int:
        """The next pose, by its T_i_j (4, 4) from the last one and the covariance (6, 6) of that. Returns its index.

        Raises ValueError where the covariance is not positive definite or a number is not finite.
        """
        edge = Edge(len(self) - 1, len(self), pose, covariance)
        self._online.add_odometry(edge)
        self.odometry.append(edge)
        return edge.j

    def add_loop(self, candidate: LoopCandidate, covariance: Array) -> None:
        """A verified loop, with the covariance (6, 6) of its pose. Raises ValueError as `add_odometry` does."""
        edge = Edge(candidate.i, candidate.j, candidate.pose, covariance)
        if not (0 <= edge.i < len(self) and 0 <= edge.j < len(self)):
            raise ValueError(f"loop {edge.i} -> {edge.j}: there are only poses 0 to {len(self) - 1}")
        self._online.add_loop(edge)
        self._loops.append((len(self._records), edge))
        self._records.append(LoopRecord(candidate, 0.0, "accepted", "verified"))

    def reject(self, candidate: LoopCandidate, reason: str) -> None:
        """A candidate that its verification refused: it goes into the ledger alone."""
        self._records.append(LoopRecord(candidate, 0.0, "rejected", reason))

    @property
    def has_loops(self) -> bool:
        """Whether any loop is accepted as yet."""
        return any(self._records[record].status == "accepted" for record, _ in self._loops)

    def poses(self) -> Array:
        """All T_world_i (N, 4, 4) by all edges so far."""
        return self._online.poses()

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
        self._online = Incremental(self.odometry, kept, verdict.poses)

    def ledger(self) -> list[LoopRecord]:
        """Every candidate and its fate, as they came. A loop that `settle` has not seen has its weight so far."""
        records, poses = list(self._records), self.poses()
        for record, edge in self._loops[self._judged :]:
            weight = self._online.loop_weight(float(np.sqrt(disagreement(edge, poses))))
            records[record] = replace(records[record], weight=weight)
        return records

    def graph(self) -> PoseGraph:
        """The poses, the odometry and the accepted loops, as g2o takes them."""
        accepted = [edge for record, edge in self._loops if self._records[record].status == "accepted"]
        return PoseGraph(self.poses(), (*self.odometry, *accepted))
