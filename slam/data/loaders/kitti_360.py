"""KITTI-360 (Liao et al., PAMI 2022): KITTI's successor, a Velodyne HDL-64E and two cameras on a car in Karlsruhe."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError
from slam.data.files import matrix, read_keyed_numbers
from slam.data.ground_truth import truth_of
from slam.data.kitti_raw import KittiRaw
from slam.data.pose_files import read_trajectory
from slam.data.pose_table import read_pose_table
from slam.data.problem import Problem
from slam.data.sensor import Sensor, load_sensor, sensor_of_folder

SCANS = "data_3d_raw"


class Kitti360(KittiRaw):
    """`data_3d_raw/<drive>/velodyne_points/` of a drive, and `data_poses/`, `calibration/`, `data_2d_raw/` of its root.

    Scans are not motion-compensated, as KITTI's raw ones; stamps in timestamps.txt refer to mid-sweep. The ground
    truth, poses.txt, has the frame's number and 3 x 4 of the IMU, for frames in which the car moved; it is moved into
    the LiDAR by calib_cam_to_pose.txt and calib_cam_to_velo.txt. The camera is image_00, rectified (data_rect). Fisheye
    cameras, the SICK scanner and OXTS are not read.
    """

    LAYOUT = "KITTI-360 (data_3d_raw/*_sync/velodyne_points/data/*.bin)"
    MAKER = "KITTI-360"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the sequences of a root, of its data_3d_raw, or one of these, by their names. See `Loader`."""
        if path.parent.name == SCANS:
            return {path.name: path} if (path / "velodyne_points" / "data").is_dir() else {}
        root = path if path.name == SCANS else path / SCANS
        folders = [folder.parent.parent for folder in sorted(root.glob("*/velodyne_points/data"))]
        return {folder.name: folder for folder in folders}

    @property
    def _root(self) -> Path:
        return self.path.parent.parent

    def _lasers(self, path: Path, override: str | Path | None) -> Sensor:
        default = load_sensor("hdl64")
        return sensor_of_folder(path, override, default) or default

    def _image_place(self, path: Path) -> Path:
        return path.parent.parent / "data_2d_raw" / path.name / "image_00" / "data_rect"

    def _read_calibration(self) -> tuple[Calibration | None, tuple[Problem, ...]]:
        folder = self._root / "calibration"
        lidar, camera = folder / "calib_cam_to_velo.txt", folder / "perspective.txt"
        if not (lidar.is_file() and camera.is_file()):
            text = f"{folder}: no calib_cam_to_velo.txt and perspective.txt in it"
            return None, (Problem("no calibration", f"{text}; the camera is not used"),)
        entries = read_keyed_numbers(camera)
        T_rectified_lidar = matrix(entries, camera, "R_rect_00") @ se3.inverse(_rigid(lidar))
        return Calibration(matrix(entries, camera, "P_rect_00")[:3, :3], T_rectified_lidar), ()

    def _read_ground_truth(self, start: np.datetime64 | None) -> tuple[Array | None, tuple[Problem, ...]]:
        file = self._root / "data_poses" / self.path.name / "poses.txt"
        if not file.is_file():
            return None, ()
        camera, lidar = (self._root / "calibration" / f"calib_cam_to_{name}.txt" for name in ("pose", "velo"))
        if not (camera.is_file() and lidar.is_file()):
            text = f"{file}: left out, for there are no {camera.name} and {lidar.name} in {camera.parent}"
            return None, (Problem("no ground truth", text),)
        T_pose_camera = matrix(read_keyed_numbers(camera), camera, "image_00")
        trajectory = read_trajectory(file)
        if trajectory.numbers is None:
            raise InputError(f"{file}: KITTI-360's poses have 13 columns, the frame's number and a 3x4 matrix")
        poses = trajectory.poses @ T_pose_camera @ se3.inverse(_rigid(lidar))
        truth = truth_of(file, replace(trajectory, poses=poses), self.stamps, self.numbers, known_times=True)
        return truth.poses, truth.problems


def _rigid(file: Path) -> Array:
    """Read a matrix (4, 4) from a file with a 3x4 matrix on one line."""
    values = read_pose_table(file).values
    if values.size != 12 or not np.isfinite(values).all():
        raise InputError(f"{file}: 12 numbers are needed, a 3x4 matrix; copy the file afresh")
    return np.vstack([values.reshape(3, 4), [0, 0, 0, 1]])
