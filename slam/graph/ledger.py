"""Records of all loop candidates: evidence, decision and reason."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, overload

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array
from slam.data.growing import Growing
from slam.graph.pose_graph import Edge

FIELDS = (
    "i",
    "j",
    "distance",
    "yaw_deg",
    "inlier_ratio",
    "overlap",
    "weight",
    "status",
    "reason",
    "tx",
    "ty",
    "tz",
    "qx",
    "qy",
    "qz",
    "qw",
)
Status = Literal["accepted", "rejected"]


@dataclass(frozen=True, eq=False)
class LoopCandidate:
    """Two poses that may be at the same place.

    Attributes:
        i: Index of the earlier pose.
        j: Index of the later pose.
        pose: (4, 4) T_i_j: registered, or the initial guess without a registration.
        distance: Distance of the descriptors; NaN if they were not compared.
        yaw: Yaw from the descriptors [rad].
        inlier_ratio: Inlier ratio of the verification; NaN without a registration.
        overlap: Overlap of the verification; NaN without a registration.
    """

    i: int
    j: int
    pose: Array
    distance: float = float("nan")
    yaw: float = float("nan")
    inlier_ratio: float = float("nan")
    overlap: float = float("nan")


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """Decision on a candidate: its weight in the graph, 0 to 1, and a short reason."""

    candidate: LoopCandidate
    weight: float
    status: Status
    reason: str


class Ledger(Sequence[LoopRecord]):
    """The records of all candidates, in order, with the edges of those that were verified; 0.5 kB each."""

    def __init__(self) -> None:
        self._candidates, self._decisions = Growing(6 + 16), Growing(2)  # the weight, and whether it is accepted
        self._covariances = Growing(6, 6)  # NaN without a registration
        self._reasons: list[str] = []

    def __len__(self) -> int:
        return len(self._reasons)

    @overload
    def __getitem__(self, number: int) -> LoopRecord: ...
    @overload
    def __getitem__(self, number: slice) -> list[LoopRecord]: ...
    def __getitem__(self, number: int | slice) -> LoopRecord | list[LoopRecord]:
        if isinstance(number, slice):
            return [self[each] for each in range(*number.indices(len(self)))]
        i, j, *evidence = (row := self._candidates[number])[:6].tolist()
        candidate = LoopCandidate(int(i), int(j), row[6:].reshape(4, 4), *evidence)
        weight, accepted = self._decisions[number].tolist()
        return LoopRecord(candidate, weight, "accepted" if accepted else "rejected", self._reasons[number])

    def append(self, record: LoopRecord, covariance: Array | None) -> int:
        """Append a record, and the covariance (6, 6) of the pose of a verified loop; return its number."""
        loop = record.candidate
        evidence = (loop.i, loop.j, loop.distance, loop.yaw, loop.inlier_ratio, loop.overlap)
        self._candidates.append(np.concatenate([evidence, loop.pose.ravel()]))
        self._covariances.append(np.nan if covariance is None else covariance)
        self._decisions.append(np.array([record.weight, record.status == "accepted"]))
        self._reasons.append(record.reason)
        return len(self) - 1

    def decide(self, number: int, weight: float, status: Status, reason: str) -> None:
        """Change the decision on a candidate."""
        self._decisions[number] = np.array([weight, status == "accepted"])
        self._reasons[number] = reason

    def edge(self, number: int) -> Edge:
        """Return the edge of a verified loop."""
        loop = self[number].candidate
        return Edge(loop.i, loop.j, loop.pose, self._covariances[number])


def csv_text(ledger: Iterable[LoopRecord], frames: Sequence[int] | None = None) -> str:
    """Format the ledger as loops.csv; pose k is frame `frames[k]`, or frame k. Unknown values are left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(FIELDS)
    for record in ledger:
        loop = record.candidate
        i, j = (loop.i, loop.j) if frames is None else (frames[loop.i], frames[loop.j])
        evidence = (loop.distance, float(np.degrees(loop.yaw)), loop.inlier_ratio, loop.overlap, record.weight)
        quaternion = Rotation.from_matrix(loop.pose[:3, :3]).as_quat(canonical=True)
        pose = (f"{value:.10g}" for value in (*loop.pose[:3, 3], *quaternion))
        writer.writerow([i, j, *(_short(value) for value in evidence), record.status, record.reason, *pose])
    return text.getvalue()


def _short(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else ""
