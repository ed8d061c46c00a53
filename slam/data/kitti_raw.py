"""One drive of KITTI's raw data, synchronised and rectified (`..._sync`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data import oxts, se3
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError
from slam.data.files import (
    files_by_number,
    gaps,
    matrix,
    read_keyed_numbers,
    rows_by_number,
)
from slam.data.kitti import KittiDrive, rectified_camera
from slam.data.problem import Problem
from slam.data.sensor import kitti_sensor


class KittiRaw(KittiDrive):
    """`velodyne_points/`, `image_02/` and `oxts/` of one drive; calibration files beside the drive or inside it.

    Scans are as the sensor swept them: the cloud has times. Stamps count from the first scan. The ground truth is
    OXTS, interpolated at the scans' stamps. See `Dataset` for the fields. Raises InputError where there are no scans
    or a file holds something else than it should.
    """

    LAYOUT = "KITTI raw (*_sync/velodyne_points/data/*.bin)"

    @staticmethod
    def drives(path: Path) -> dict[str, Path]:
        """The drive folders at or under a path by their names. See `Loader`."""
        for pattern in (".", "*", "*/*"):
            found = sorted(path.glob(f"{pattern}/velodyne_points/data"))
            if found:
                return {folder.parent.parent.name: folder.parent.parent for folder in found}
        return {}

    def __init__(self, path: Path, sensor: str | Path | None = None) -> None:
        self.name = f"KITTI raw {path.name.removesuffix('_sync')}"
        lasers = kitti_sensor(path, sensor, motion_compensated=False)
        super().__init__(path, lasers, path / "velodyne_points" / "data", path / "image_02" / "data")
        times = path / "velodyne_points" / "timestamps.txt"
        clock = rows_by_number(_read_clock(times), self.numbers, times)
        self.stamps = (clock - clock[0]) / np.timedelta64(1, "s")
        if not (np.diff(self.stamps) > 0).all():
            line = int(np.argmin(np.diff(self.stamps) > 0)) + 2
            raise InputError(f"{times}: the times do not rise at scan {line} of {len(clock)}; copy the file afresh")
        self.calibration, uncalibrated = self._read_calibration()
        self.ground_truth, untrue = self._read_ground_truth(clock[0])
        self.problems = (*self._told, *gaps(self.numbers, path / "velodyne_points"), *uncalibrated, *untrue)

    def _find(self, name: str) -> Path | None:
        """A calibration file: KITTI has it at the level of the date, some copies inside the drive."""
        places = [folder / name for folder in (self.path, self.path.parent) if (folder / name).is_file()]
        return places[0] if places else None

    def _read_calibration(self) -> tuple[Calibration | None, tuple[Problem, ...]]:
        lidar, camera = self._find("calib_velo_to_cam.txt"), self._find("calib_cam_to_cam.txt")
        if lidar is None or camera is None:
            text = f"{self.path}: no calib_velo_to_cam.txt and calib_cam_to_cam.txt here or beside it"
            return None, (Problem("no calibration", f"{text}; the camera is not used"),)
        entries = read_keyed_numbers(camera)
        rectified = matrix(entries, camera, "R_rect_00") @ matrix(read_keyed_numbers(lidar), lidar, "R", "T")
        return rectified_camera(matrix(entries, camera, "P_rect_02"), rectified), ()

    def _read_ground_truth(self, start: np.datetime64) -> tuple[Array | None, tuple[Problem, ...]]:
        files = files_by_number(self.path / "oxts" / "data", (".txt",))
        calibration = self._find("calib_imu_to_velo.txt")
        if len(files) < 2:
            return None, ()
        if calibration is None:
            text = f"{self.path / 'oxts'}: left out, for there is no calib_imu_to_velo.txt in {self.path} or beside it"
            return None, (Problem("no ground truth", text),)
        T_lidar_imu = matrix(read_keyed_numbers(calibration), calibration, "R", "T")
        times = self.path / "oxts" / "timestamps.txt"
        stamps = rows_by_number(_read_clock(times), np.array(list(files)), times)
        seconds = (stamps - start) / np.timedelta64(1, "s")
        poses = oxts.imu_poses(oxts.read_packets(list(files.values()))) @ se3.inverse(T_lidar_imu)
        # Some drives hold packets whose stamps stand still or run backwards.
        rising = np.concatenate([[True], seconds[1:] > np.maximum.accumulate(seconds)[:-1]])
        truth = oxts.poses_at(seconds[rising], poses[rising], self.stamps)
        lost = int(np.isnan(truth[:, 0, 0]).sum())
        text = f"{self.path / 'oxts'}: no packet near {lost} of {len(truth)} scans; they are without truth"
        return se3.from_first(truth), (Problem("no ground truth", text),) if lost else ()


def _read_clock(path: Path) -> Array:
    """(N,) datetime64[ns] of KITTI's timestamps.txt. Raises InputError where it is missing or holds anything else."""
    try:
        lines = path.read_text(encoding="ascii").split("\n")
        return np.array([line.strip() for line in lines if line.strip()], "datetime64[ns]")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); copy it from KITTI's drive") from error
    except ValueError as error:
        raise InputError(f"{path}: lines like '2011-09-26 13:04:32.335337762' are expected ({error})") from error
