"""trajectory_covariance.csv: the covariance of each pose of a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError

AXES = ("roll", "pitch", "yaw", "x", "y", "z")  # of a tangent vector: rad, rad, rad, m, m, m
ROWS, COLUMNS = np.triu_indices(6)
HEADER = ("frame", "stamp_s", *(f"{AXES[row]}_{AXES[column]}" for row, column in zip(ROWS, COLUMNS, strict=True)))
#: The content in one sentence, for the protocol of a run.
MEANING = (
    "the true T_world_lidar is pose @ exp(xi), xi = (roll, pitch, yaw, x, y, z) [rad, m] in the LiDAR's axes at that "
    "pose, with zero mean and this covariance (upper triangle, row by row); the first pose is exact by definition"
)


def covariance_text(frames: Sequence[int], stamps: Array, covariances: Array) -> str:
    """Format covariances (N, 6, 6) of frames with stamps (N,) [s]: a row per pose, the upper triangle row by row."""
    rows = [",".join(HEADER)]
    for frame, stamp, upper in zip(frames, stamps, covariances[:, ROWS, COLUMNS], strict=True):
        rows.append(f"{frame},{stamp:.9f}," + ",".join(f"{value:.9g}" for value in upper))
    return "\n".join(rows) + "\n"


def read_covariances(path: Path) -> tuple[Array, Array]:
    """Read stamps (N,) [s] and covariances (N, 6, 6) of a trajectory_covariance.csv.

    Raises:
        InputError: The file is missing or has other content.
    """
    try:
        header, *lines = path.read_text(encoding="utf-8").splitlines()
        rows = np.array([[float(value) for value in line.split(",")] for line in lines]).reshape(-1, len(HEADER))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as covariances ({error}); run again") from error
    if header.split(",") != list(HEADER):
        raise InputError(f"{path}: the first line is not that of a trajectory_covariance.csv; run again")
    covariances = np.zeros((len(rows), 6, 6))
    covariances[:, ROWS, COLUMNS] = covariances[:, COLUMNS, ROWS] = rows[:, 2:]
    return rows[:, 1], covariances
