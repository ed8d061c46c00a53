"""Shared by the loaders of stamped scans: search for sequences, opening of scans, poses from tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array
from slam.data.conventions import Conventions
from slam.data.errors import InputError
from slam.data.first_scans import first_of
from slam.data.ground_truth import GroundTruth, truth_of
from slam.data.point_files import Reading
from slam.data.pose_files import Trajectory
from slam.data.pose_table import read_pose_table
from slam.data.problem import Problem
from slam.data.scan_names import in_order, stamps_of_names
from slam.data.scan_sequence import ScanSequence
from slam.data.sensor import Sensor, conventions_of_folder, sensor_of_folder

#: Offset of coordinates that are in the sensor's own frame.
HERE = (0.0, 0.0, 0.0)


def folders_with(path: Path, *insides: str) -> dict[str, Path]:
    """Find folders with files that match one of the patterns `insides`: the folder itself, or else its subfolders.

    Returns:
        The folders by their names.
    """
    for folders in ([path], sorted(folder for folder in path.glob("*") if folder.is_dir())):
        found = {folder.name: folder for folder in folders if any(any(folder.glob(inside)) for inside in insides)}
        if found:
            return found
    return {}


class StampedSequence(ScanSequence):
    """A sequence whose scans are files named by their stamps.

    Args:
        path: Folder of the sequence.
        name: Name for tables and run.json.
        scans: Folder of the scans.
        suffix: Suffix of the scans' files.
        unit: Unit of the stamps in their names, 'us' or 'ns'; None for names of another form.
        reading: How the files are read.
        default: The LiDAR, None if its laser lines are unknown; overridden by sensor.yaml in `path`.
        sensor: Overrides the LiDAR (see `load_sensor`).
        instant: Instant of the sweep that the stamps refer to, if known; overridden by sensor.yaml.
        stamp: Overrides the instant.
        point_time: Field with the points' times, if the user names one.
        compensated: The data set's makers deskewed the scans.

    Raises:
        InputError: There are no scans, or none of the first can be read.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        scans: Path,
        suffix: str,
        unit: str | None,
        reading: Reading,
        *,
        default: Sensor | None = None,
        sensor: str | Path | None = None,
        instant: str | None = None,
        stamp: str | None = None,
        point_time: str | None = None,
        compensated: bool = False,
    ) -> None:
        files = [file for file in scans.glob(f"*{suffix}") if not file.name.startswith(".")]
        if not files:
            raise InputError(f"{scans}: no {suffix} files in it; unpack the scans of {name} there")
        names = in_order(files, unit)
        first_of(names.files, reading)
        stamps, stamps_from, mended = stamps_of_names(path, names)
        lasers = sensor_of_folder(path, sensor, default)
        said = Conventions(stamp=instant).over(conventions_of_folder(path, sensor)).said(stamp, point_time)
        ordered = replace(names, stamps=stamps)
        super().__init__(
            path,
            name,
            ordered,
            stamps_from,
            reading,
            lasers,
            said,
            compensated=compensated,
            no_stamps=f"the names in {scans.name}/ are no stamps",
        )
        self.note(*mended)

    def take_trajectory(self, file: Path, trajectory: Trajectory, T_body_lidar: Array | None = None) -> None:
        """Take the ground truth from a trajectory of a body.

        Args:
            file: File of the trajectory, for messages.
            trajectory: Poses of the body.
            T_body_lidar: (4, 4) pose of the LiDAR on the body; None: the body is the LiDAR.
        """
        if T_body_lidar is not None:
            trajectory = replace(trajectory, poses=trajectory.poses @ T_body_lidar)
        self.take_truth(truth_of(file, trajectory, self.stamps, self.numbers, self.known_times))

    def without_truth(self, text: str) -> None:
        """Note that there is no ground truth, and why."""
        self.take_truth(GroundTruth(problems=(Problem("no ground truth", f"{text}; there is no ground truth"),)))


def angle_trajectory(file: Path, columns: tuple[str, ...], inverse: bool = False) -> Trajectory:
    """Read poses from a table with roll, pitch and heading, which turn about x, y and then z.

    Args:
        file: The table; a row with NaN is an unknown pose.
        columns: Names of its columns: the stamp [us], x, y and z [m] first, and roll, pitch and heading [rad].
        inverse: The angles describe the inverse rotation.

    Raises:
        InputError: The table has another number of columns.
    """
    table = read_pose_table(file)
    if table.values.shape[1] != len(columns):
        raise InputError(f"{file}: {table.values.shape[1]} columns; these are expected: {' '.join(columns)}")
    known = np.asarray(np.isfinite(table.values).all(axis=1))
    values = np.where(known[:, np.newaxis], table.values, 0.0)
    turns = Rotation.from_euler("ZYX", values[:, [columns.index(name) for name in ("heading", "pitch", "roll")]])
    poses = poses_of(values[:, 1:4], turns.inv() if inverse else turns)
    poses[~known] = np.nan
    return Trajectory(poses, table.lines, table.values[:, 0] * 1e-6)


def poses_of(positions: Array, rotation: Rotation) -> Array:
    """Return the poses (N, 4, 4) of positions (N, 3) [m] and N rotations."""
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotation.as_matrix(), positions
    return poses


def pose(x: float, y: float, z: float, rotation: Rotation) -> Array:
    """Return the pose (4, 4) of a position [m] and a rotation."""
    return np.asarray(poses_of(np.array([[x, y, z]]), Rotation.concatenate([rotation]))[0])
