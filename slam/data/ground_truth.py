"""The ground truth of a folder of scans, poses.txt."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import read_poses
from slam.data.problem import Problem


def read_ground_truth(
    path: Path, stamps: Array, numbers: Array, known_times: bool
) -> tuple[Array | None, tuple[Problem, ...]]:
    """The truth of each scan, by time where the poses have stamps, else by row.

    Args:
        path: The drive's folder.
        stamps: (N,) [s] of the scans.
        numbers: (N,) int64, the numbers in their names.
        known_times: Whether the stamps were recorded, not assumed.

    Returns:
        (N, 4, 4) T_world_lidar, the first known one identity, NaN where unknown, or None; and what is wrong with it.

    Raises:
        InputError: poses.txt holds something else than poses.
    """
    path = path / "poses.txt"
    if not path.is_file():
        return None, ()
    known, poses = read_poses(path)
    truth = np.full((len(stamps), 4, 4), np.nan)
    if known is not None and known_times:
        if len(known) < 2 or (np.diff(known) <= 0).any():
            raise InputError(f"{path}: the stamps of at least two poses, rising, are needed")
        inside = (stamps >= known[0]) & (stamps <= known[-1])
        truth[inside] = se3.interpolate(known, poses, stamps[inside])
    elif len(poses) > numbers[-1] and len(poses) != len(stamps):
        truth = poses[numbers]
    else:
        truth[: len(poses)] = poses[: len(stamps)]
    lost = int(np.isnan(truth[:, 0, 0]).sum())
    text = f"{path}: {len(poses)} poses for {len(stamps)} scans; {lost} scans are without truth"
    return se3.from_first(truth), (Problem("poses shorter than scans", text),) if lost else ()
