"""Newer College (Ramezani et al., IROS 2020): an Ouster OS1-64 in the hand, in Oxford."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.errors import InputError
from slam.data.loaders.common import HERE, StampedSequence, folders_with, pose, poses_of
from slam.data.point_files import Reading
from slam.data.pose_files import Trajectory
from slam.data.pose_table import read_pose_table

PLACES = ("raw_format/ouster_scan", "ouster_scan")
#: The LiDAR in the frame of the ground truth, from pyLiDAR-SLAM's and KISS-ICP's loaders: metres, quaternion w last.
T_BASE_LIDAR = pose(-0.084, -0.025, 0.050, Rotation.from_quat([0.0, 0.0, 0.924, 0.383]))


class NewerCollege(StampedSequence):
    """`raw_format/ouster_scan/cloud_<s>_<ns>.pcd` of one experiment, and `ground_truth/registered_poses.csv`.

    Scans are Ouster's clouds, with times (t, ns from the stamp) and rings if the files have these fields; .ply files
    are read, too. The ground truth (sec nsec x y z qx qy qz qw) is that of the device, moved into the LiDAR. The laser
    lines are those of the first generation, which no built-in table has. IMU and images are not read.
    """

    LAYOUT = "Newer College (raw_format/ouster_scan/*.pcd)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the experiments at or below a path by their names. See `Loader`."""
        return folders_with(path, *(f"{place}/*.{suffix}" for place in PLACES for suffix in ("pcd", "ply")))

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        scans = next((path / place for place in PLACES if (path / place).is_dir()), path / PLACES[0])
        super().__init__(
            path,
            f"Newer College {path.name}",
            scans,
            ".pcd" if any(scans.glob("*.pcd")) else ".ply",
            None,
            Reading(offset=HERE),
            sensor=sensor,
            stamp=stamp,
            point_time=point_time,
        )
        truth = path / "ground_truth" / "registered_poses.csv"
        if truth.is_file():
            self.take_trajectory(truth, _trajectory(truth), T_BASE_LIDAR)


def _trajectory(file: Path) -> Trajectory:
    table = read_pose_table(file)
    if table.values.shape[1] != 9:
        text = f"{table.values.shape[1]} columns; Newer College's truth is sec nsec x y z qx qy qz qw"
        raise InputError(f"{file}: {text}")
    values = table.values
    known = np.isfinite(values).all(axis=1) & (np.linalg.norm(values[:, 5:], axis=1) > 1e-6)
    turns = np.where(known[:, None], values[:, 5:], [0.0, 0.0, 0.0, 1.0])
    poses = poses_of(values[:, 2:5], Rotation.from_quat(turns))
    poses[~known] = np.nan
    return Trajectory(poses, table.lines, values[:, 0] + 1e-9 * values[:, 1])
