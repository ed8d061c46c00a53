"""Keyframes, places, edges and loops as rows of a session."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.graph.back_end import BackEnd
from slam.graph.ledger import LoopCandidate, LoopRecord
from slam.graph.pose_graph import Edge
from slam.journal.journal import Journal
from slam.journal.session_file import REMEDY, SessionFile
from slam.journal.tables import DECISION, EDGE, KEYFRAME, LOOP, OPTIMISED, PLACE, RowError, array_of, text_of
from slam.loops.closing import LoopSearch
from slam.loops.verification import Verification
from slam.settings import Config


@dataclass(frozen=True)
class MappingRecord:
    """Writes the rows of a run's mapping; the storage of its keyframes."""

    journal: Journal

    def store(self, index: int, travelled: float, pose: Array, block: bytes) -> None:
        """Write the next keyframe, see `Storage`."""
        self.journal.append(KEYFRAME, int(index), float(travelled), text_of(pose), block)

    def block(self, number: int) -> bytes:
        """Return the block of a keyframe, see `Storage`."""
        return self.journal.cloud(number)

    def edge(self, edge: Edge) -> None:
        """Write an odometry edge."""
        self.journal.append(EDGE, edge.i, edge.j, text_of(edge.pose), text_of(edge.covariance))

    def place(self, travelled: float, descriptor: Array | None) -> None:
        """Write the descriptor (rings, sectors) of the next keyframe, None at a known place."""
        self.journal.append(PLACE, float(travelled), b"" if descriptor is None else descriptor.astype("<f4").tobytes())

    def loop(self, loop: LoopCandidate, verification: Verification) -> None:
        """Write a candidate with its verification."""
        evidence = (loop.distance, loop.yaw, loop.inlier_ratio, loop.overlap)
        covariance = text_of(verification.covariance if verification.accepted else np.zeros((0, 6)))
        self.journal.append(
            LOOP, loop.i, loop.j, *map(float, evidence), verification.reason, text_of(loop.pose), covariance
        )

    def result(self, poses: Array, ledger: Sequence[LoopRecord]) -> None:
        """Write the optimised poses (K, 4, 4) of the keyframes and the decisions on all candidates, once."""
        written = self.journal.counts()
        for pose in poses[written[OPTIMISED.name] :]:
            self.journal.append(OPTIMISED, text_of(pose))
        for record in ledger[written[DECISION.name] :]:
            self.journal.append(DECISION, float(record.weight), record.status, record.reason)


def kept_keyframes(file: SessionFile) -> list[tuple[int, Array, float]]:
    """Return index, pose (4, 4) and travelled distance [m] of all keyframes.

    Raises:
        InputError: A row is damaged.
    """
    try:
        kept = [(position, array_of(pose, 4, 4), travelled) for position, travelled, pose in file.keyframes()]
    except RowError as error:
        raise InputError(f"{file.path}: damaged ({error}); {REMEDY}") from error
    rising = all(a[0] < b[0] and a[2] <= b[2] for a, b in pairwise(kept))
    if not rising or (kept and kept[0][0] < 0):
        raise InputError(f"{file.path}: damaged (the keyframes are not in order); {REMEDY}")
    return kept


def restore_places(file: SessionFile, config: Config, poses: Array, search: LoopSearch) -> None:
    """Add the places of all searched keyframes to a search.

    Args:
        file: The session.
        config: The settings.
        poses: (K, 4, 4) T_world_keyframe by the odometry.
        search: The search.

    Raises:
        InputError: A row is damaged.
    """
    shape = config.loops.scan_context.rings, config.loops.scan_context.sectors
    travelled: list[float] = []
    descriptors: list[Array | None] = []
    for distance, block in file.rows(PLACE):
        values = np.frombuffer(block, "<f4") if len(block) in (0, 4 * shape[0] * shape[1]) else np.full(1, np.nan)
        if not np.isfinite(values).all() or (travelled and not distance >= travelled[-1]):
            raise InputError(f"{file.path}: damaged (place {len(travelled)}); {REMEDY}")
        travelled.append(distance)
        descriptors.append(values.reshape(shape) if block else None)
    try:
        loops = {loop.j: (loop.i, loop.pose) for loop, _, reason in _loops(file, len(poses) - 1) if not reason}
        search.restore(descriptors, poses, travelled, loops)
    except (ValueError, LookupError) as error:
        raise InputError(f"{file.path}: damaged ({error}); {REMEDY}") from error


def add_edges(file: SessionFile, back_end: BackEnd) -> None:
    """Add all edges and candidates to a back end.

    Raises:
        InputError: A row is damaged.
    """
    try:
        edges = [Edge(i, j, array_of(pose, 4, 4), array_of(P, 6, 6)) for i, j, pose, P in file.rows(EDGE)]
        known = {number for number, (_, block) in enumerate(file.rows(PLACE)) if block == b""}
        back_end.restore(edges, list(_loops(file, len(edges))), known)
    except ValueError as error:  # RowError is one
        raise InputError(f"{file.path}: damaged ({error}); {REMEDY}") from error


def _loops(file: SessionFile, edges: int) -> Iterator[tuple[LoopCandidate, Array | None, str]]:
    """The candidates, each with its covariance (6, 6), or None and the reason of a rejection."""
    for i, j, distance, yaw, inliers, overlap, reason, pose, covariance in file.rows(LOOP):
        if not 0 <= i < j <= edges:
            raise RowError(f"loop {i} -> {j} with {edges} edges")
        candidate = LoopCandidate(i, j, array_of(pose, 4, 4), distance, yaw, inliers, overlap)
        yield candidate, None if reason else array_of(covariance, 6, 6), reason
