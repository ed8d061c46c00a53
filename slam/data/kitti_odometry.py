"""One sequence of the KITTI odometry benchmark, whole or in part."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data import se3
from slam.data.body_frame import body_frame, into_lidar_frame
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError
from slam.data.files import (
    SCAN_PERIOD,
    gaps,
    matrix,
    read_keyed_numbers,
)
from slam.data.kitti import KittiSequence, rectified_camera
from slam.data.pose_files import read_trajectory
from slam.data.problem import Problem
from slam.data.sensor import conventions_of_folder, kitti_sensor, nominal_lines
from slam.data.stamps import mended, usual_step
from slam.data.time_files import read_rows


class KittiOdometry(KittiSequence):
    """`velodyne/`, `image_2/`, `calib.txt`, `times.txt` of one sequence folder, and `poses/NN.txt` of its root.

    Lines of times.txt and of the poses are assigned to scans by the number in the file name, so that a part of a
    sequence works with the files of the whole. Scans are stored ring after ring, top ring first, and are
    motion-compensated, unless a sensor.yaml in the folder says that they are not: then the clouds have times, as those
    of KITTI's raw drives do. See `Dataset` for the properties.

    Raises:
        InputError: There are no scans, or a file has an unexpected content.
    """

    LAYOUT = "KITTI odometry (sequences/NN/velodyne/*.bin, or calib.txt beside velodyne/)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the sequence folders at or under a path, by name. See `Loader`."""
        if (path / "velodyne").is_dir():
            kitti = path.parent.name == "sequences" or (path / "calib.txt").exists()
            return {path.name: path} if kitti and not (path / "calib.yaml").exists() else {}
        root = path / "sequences" if (path / "sequences").is_dir() else path
        found = {folder.parent.name: folder.parent for folder in sorted(root.glob("*/velodyne"))}
        return found if root.name == "sequences" else {}

    def __init__(self, path: Path, sensor: str | Path | None = None, *, stamp: str | None = None) -> None:
        maker = (
            path.parent.parent.name if (path / "sensor.yaml").is_file() else "KITTI odometry"
        )  # a sensor other than KITTI's
        self.name = f"{maker} {path.name}"
        lasers = kitti_sensor(path, sensor, motion_compensated=True)
        said = conventions_of_folder(path, sensor).said(stamp)
        super().__init__(path, lasers, sensor, said.stamp, path / "velodyne", path / "image_2")
        self.stamps, slow = self._read_stamps()
        self.calibration, uncalibrated = self._read_calibration()
        self.ground_truth, untrue = self._read_ground_truth()
        self.problems = (
            *nominal_lines(self.sensor),
            *self._told,
            *gaps(self.numbers, path / "velodyne"),
            *slow,
            *uncalibrated,
            *untrue,
        )

    def _read_stamps(self) -> tuple[Array, tuple[Problem, ...]]:
        path = self.path / "times.txt"
        times, unit = read_rows(path) if path.exists() else (np.zeros(0), "")
        if len(times) > self.numbers[-1]:
            stamps = times[self.numbers]
            if usual_step(stamps) is not None or len(stamps) == 1:
                self._has_stamps(times, f"times.txt, {unit}")
                return mended(stamps, path)
            fault = "all of its times are the same"
        else:
            fault = (
                f"{len(times)} times, but scans up to number {self.numbers[-1]}" if path.exists() else "no such file"
            )
        problem = Problem("no time stamps", f"{path}: {fault}; {1 / SCAN_PERIOD:g} scans a second assumed")
        return self.numbers * SCAN_PERIOD, (problem,)

    def _read_calibration(self) -> tuple[Calibration | None, tuple[Problem, ...]]:
        path = self.path / "calib.txt"
        if not path.exists():
            return None, (Problem("no calibration", f"{path}: no such file; the camera is not used"),)
        entries = read_keyed_numbers(path)
        if "Tr" not in entries or "P2" not in entries:
            return None, (Problem("no calibration", f"{path}: no 'Tr:' or no 'P2:' in it; the camera is not used"),)
        T_camera0_lidar = matrix(entries, path, "Tr")
        return rectified_camera(matrix(entries, path, "P2"), T_camera0_lidar, path), ()

    def _read_ground_truth(self) -> tuple[Array | None, tuple[Problem, ...]]:
        path = self.path.parent.parent / "poses" / f"{self.path.name}.txt"
        if not path.exists():
            return None, ()
        if self.calibration is None:
            text = f"{path}: not used: without 'Tr:' in calib.txt, camera poses do not give those of the LiDAR"
            return None, (Problem("no ground truth", text),)
        trajectory = read_trajectory(path)
        if trajectory.stamps is not None or trajectory.numbers is not None:
            raise InputError(
                f"{path}: KITTI's poses have 12 columns, the rows of a 3x4 matrix, and no stamps or numbers"
            )
        poses = trajectory.poses
        if body_frame(poses[np.isfinite(poses).all(axis=(1, 2))]) == "lidar":
            text = f"{path}: not used: its poses move along x, as those of a LiDAR do; KITTI's are of camera 0, along z"
            return None, (Problem("no ground truth", text),)
        T_camera_lidar = self.calibration.T_camera0_lidar
        assert T_camera_lidar is not None
        truth = np.full((len(self.numbers), 4, 4), np.nan)
        there = self.numbers < len(poses)
        truth[there] = into_lidar_frame(poses[self.numbers[there]], T_camera_lidar)
        problems = []
        if unknown := int(np.isnan(truth[there, 0, 0]).sum()):
            text = f"{path}: zeros or NaN in place of the poses of {unknown} scans; they have no ground truth"
            problems.append(Problem("unknown pose", text))
        if not there.all():
            text = (
                f"{path}: {len(poses)} poses, but scans up to number {self.numbers[-1]}; "
                f"{np.sum(~there)} scans have no ground truth"
            )
            problems.append(Problem("poses shorter than scans", text))
        return se3.from_first(truth), tuple(problems)
