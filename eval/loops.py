"""Loop candidates of a run as its loops.csv has them, and which of the accepted ones the ground truth calls false."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array

#: An accepted loop whose translation is farther off the ground truth than this is false [m]; the same limit as in the
#: benchmarks of loop closure.
FALSE_BEYOND = 3.0


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop candidate.

    Attributes:
        i: Number of the earlier frame in the data set.
        j: Number of the later frame.
        T_i_j: (4, 4) the registered relative pose, or the initial guess without a registration.
        distance: Distance of the descriptors, NaN if they were not compared.
        inlier_ratio: Inlier ratio of the verification, NaN without a registration.
        overlap: Overlap of the verification, NaN without a registration.
        accepted: Whether the loop is in the pose graph.
        reason: Why it was rejected, or a remark.
    """

    i: int
    j: int
    T_i_j: Array
    distance: float
    inlier_ratio: float
    overlap: float
    accepted: bool
    reason: str


def read_loops(path: Path) -> tuple[Loop, ...]:
    """Read loops.csv; no loops without the file, as a run without keyframes writes none.

    Raises:
        KeyError: A column is missing.
        ValueError: A number is not one.
    """
    if not path.is_file():
        return ()
    with path.open(encoding="utf-8", newline="") as file:
        return tuple(_loop(row) for row in csv.DictReader(file))


def errors(loops: Sequence[Loop], poses: Array, numbers: Sequence[int]) -> Array:
    """Return how far loops are off the given poses: |trans(inv(inv(P_i) P_j) T_i_j)|.

    Args:
        loops: M loops.
        poses: T_world_lidar (N, 4, 4), NaN where unknown.
        numbers: Number in the data set of each of the N frames.

    Returns:
        The distances (M,) [m], NaN where a pose is unknown.

    Example:
        >>> line = np.tile(np.eye(4), (2, 1, 1)); line[1, 0, 3] = 5
        >>> errors([Loop(0, 7, np.eye(4), 0.1, 0.9, 0.8, True, "")], line, [0, 7])
        array([5.])
    """
    position = {number: at for at, number in enumerate(numbers)}
    off = np.full(len(loops), np.nan)
    for k, loop in enumerate(loops):
        if loop.i in position and loop.j in position:
            between = se3.inverse(poses[position[loop.i]]) @ poses[position[loop.j]]
            off[k] = np.linalg.norm((se3.inverse(between) @ loop.T_i_j)[:3, 3])
    return off


def _loop(row: dict[str, str]) -> Loop:
    T_i_j = np.eye(4)
    T_i_j[:3, :3] = Rotation.from_quat([float(row[name]) for name in ("qx", "qy", "qz", "qw")]).as_matrix()
    T_i_j[:3, 3] = [float(row[name]) for name in ("tx", "ty", "tz")]
    distance, inliers, overlap = (_number(row[name]) for name in ("distance", "inlier_ratio", "overlap"))
    accepted = row["status"] == "accepted"
    return Loop(int(row["i"]), int(row["j"]), T_i_j, distance, inliers, overlap, accepted, row["reason"])


def _number(text: str) -> float:
    """A figure of the ledger; unknown ones are left empty there."""
    return float(text) if text else float("nan")
