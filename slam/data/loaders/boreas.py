"""Boreas (Burnett et al., IJRR 2023): a Velodyne Alpha Prime and a camera on a car in Toronto, in all weathers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.bin_layout import parsed_columns
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError
from slam.data.loaders.common import HERE, StampedSequence, angle_trajectory, folders_with
from slam.data.point_files import Reading
from slam.data.pose_table import read_pose_table
from slam.data.problem import Problem
from slam.data.sensor import load_sensor

#: Columns of the ground truth; its elementary rotations turn the axes, not the vectors (pyboreas, utils/utils.py).
TRUTH = (
    *("GPSTime", "easting", "northing", "altitude", "vel_east", "vel_north", "vel_up"),
    *("roll", "pitch", "heading", "angvel_z", "angvel_y", "angvel_x"),
)


class Boreas(StampedSequence):
    """`lidar/<us>.bin`, `applanix/lidar_poses.csv`, `camera/<us>.png` and `calib/` of one sequence.

    A point is x y z intensity laser time, float32, with seconds from the stamp (pyboreas, utils/utils.py); the times
    show which instant of the sweep the stamp refers to. The ground truth is the LiDAR's own; test sequences have none.
    x is not forward, since the LiDAR is mounted turned. Images are rectified, and matched by time. Radar, Aeva and IMU
    are not read.
    """

    LAYOUT = "Boreas (lidar/*.bin beside applanix/)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the sequences at or below a path by their names. See `Loader`."""
        found = folders_with(path, "lidar/*.bin")
        return {name: folder for name, folder in found.items() if (folder / "applanix").is_dir()}

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        super().__init__(
            path,
            f"Boreas {path.name.removeprefix('boreas-')}",
            path / "lidar",
            ".bin",
            "us",
            Reading(parsed_columns("x,y,z,intensity,ring,time"), HERE),
            default=load_sensor("vls128"),
            sensor=sensor,
            stamp=stamp,
            point_time=point_time,
        )
        truth = path / "applanix" / "lidar_poses.csv"
        if truth.is_file():
            self.take_trajectory(truth, angle_trajectory(truth, TRUTH, inverse=True))
        self.calibration = self._read_calibration()
        if self.calibration is not None:
            self.take_images(path / "camera", "us")

    def _read_calibration(self) -> Calibration | None:
        camera, lidar = (self.path / "calib" / name for name in ("P_camera.txt", "T_camera_lidar.txt"))
        if not (camera.is_file() and lidar.is_file()):
            if (self.path / "camera").is_dir():
                text = f"{self.path / 'calib'}: no P_camera.txt and T_camera_lidar.txt; the camera is not used"
                self.note(Problem("no calibration", text))
            return None
        return Calibration(_matrix(camera)[:3, :3], _matrix(lidar))


def _matrix(file: Path) -> Array:
    values = read_pose_table(file).values
    if values.shape not in ((3, 4), (4, 4)) or not np.isfinite(values).all():
        raise InputError(f"{file}: a matrix of 3 x 4 or 4 x 4 finite numbers is needed; copy the file afresh")
    result = np.eye(4)
    result[: len(values)] = values
    return result
