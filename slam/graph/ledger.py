"""Records of all loop candidates: evidence, decision and reason."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array

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
