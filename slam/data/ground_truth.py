"""The ground truth of a folder of scans, poses.txt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import read_poses
from slam.data.problem import Problem


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Where the LiDAR was.

    Attributes:
        poses: (N, 4, 4) T_world_lidar of the scans, the first known one identity, NaN where unknown; None without any.
        readings: Where the file leaves open whether quaternions have w last or first, `poses` by either order ('xyzw',
            'wxyz'): the odometry tells which is right. Else empty.
        problems: What is wrong with it.
    """

    poses: Array | None = None
    readings: Mapping[str, Array] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()


def read_ground_truth(path: Path, stamps: Array, numbers: Array, known_times: bool) -> GroundTruth:
    """The truth of each scan, by time where the poses have stamps, else by row.

    Args:
        path: The drive's folder.
        stamps: (N,) [s] of the scans.
        numbers: (N,) int64, the numbers in their names.
        known_times: Whether the stamps were recorded, not assumed.

    Raises:
        InputError: poses.txt holds something else than poses.
    """
    path = path / "poses.txt"
    if not path.is_file():
        return GroundTruth()
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
    problems = (Problem("poses shorter than scans", text),) if lost else ()
    return GroundTruth(se3.from_first(truth), problems=problems)
