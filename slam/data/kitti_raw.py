"""One drive of KITTI's raw data, synchronised and rectified (`..._sync`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data import oxts, se3
from slam.data.cloud import Array, Calibration
from slam.data.files import (
    SCAN_PERIOD,
    files_by_number,
    gaps,
    matrix,
    read_keyed_numbers,
    rows_by_number,
)
from slam.data.kitti import KittiSequence, rectified_camera
from slam.data.problem import Problem
from slam.data.sensor import Sensor, conventions_of_folder, kitti_sensor, nominal_lines
from slam.data.stamps import mended
from slam.data.time_files import clock_rows, text_lines


class KittiRaw(KittiSequence):
    """`velodyne_points/`, `image_02/` and `oxts/` of one drive; calibration files in its folder or the folder above.

    Scans are not motion-compensated, and the clouds have times. Stamps begin at 0. The ground truth is interpolated
    between OXTS packets at the scans' stamps. See `Dataset` for the properties.

    Raises:
        InputError: There are no scans, or a file has an unexpected content.
    """

    LAYOUT = "KITTI raw (*_sync/velodyne_points/data/*.bin)"
    MAKER = "KITTI raw"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the folders of drives at or under a path, by name. See `Loader`."""
        for pattern in (".", "*", "*/*"):
            found = sorted(path.glob(f"{pattern}/velodyne_points/data"))
            if found:
                return {folder.parent.parent.name: folder.parent.parent for folder in found}
        return {}

    def __init__(self, path: Path, sensor: str | Path | None = None, *, stamp: str | None = None) -> None:
        self.name = f"{self.MAKER} {path.name.removesuffix('_sync')}"
        said = conventions_of_folder(path, sensor).said(stamp)
        scans, images = path / "velodyne_points" / "data", self._image_place(path)
        super().__init__(path, self._lasers(path, sensor), sensor, said.stamp, scans, images)
        self.stamps, start, unusual = self._read_stamps()
        self.calibration, uncalibrated = self._read_calibration()
        self.ground_truth, untrue = self._read_ground_truth(start)
        self.problems = (
            *nominal_lines(self.sensor),
            *self._told,
            *gaps(self.numbers, path / "velodyne_points"),
            *unusual,
            *uncalibrated,
            *untrue,
        )

    def _lasers(self, path: Path, override: str | Path | None) -> Sensor:
        return kitti_sensor(path, override, motion_compensated=False)

    def _image_place(self, path: Path) -> Path:
        return path / "image_02" / "data"

    def _read_stamps(self) -> tuple[Array, np.datetime64 | None, tuple[Problem, ...]]:
        """Read stamps (N,) [s] since the first scan, the time of the first scan, and problems."""
        path = self.path / "velodyne_points" / "timestamps.txt"
        every = _read_clock(path)
        clock = np.zeros(0, "datetime64[ns]") if every is None else rows_by_number(every, self.numbers, path)
        known = clock[~np.isnat(clock)]
        if every is None or len(known) == 0 or (len(clock) > 1 and (known == known[0]).all()):
            fault = "no such file" if every is None else "all of its times are the same"
            text = f"{path}: {fault}; {1 / SCAN_PERIOD:g} scans a second assumed"
            return (self.numbers - self.numbers[0]) * SCAN_PERIOD, None, (Problem("no time stamps", text),)
        self._has_stamps((every - known[0]) / np.timedelta64(1, "s"), "timestamps.txt, dates")
        stamps, problems = mended((clock - known[0]) / np.timedelta64(1, "s"), path)
        start = known[0] + np.timedelta64(round(stamps[0] * 1e9), "ns")
        return stamps - stamps[0], start, problems

    def _find(self, name: str) -> Path | None:
        """Find a calibration file: KITTI has it in the folder of the date, some copies have it in that of the drive."""
        places = [folder / name for folder in (self.path, self.path.parent) if (folder / name).is_file()]
        return places[0] if places else None

    def _read_calibration(self) -> tuple[Calibration | None, tuple[Problem, ...]]:
        lidar, camera = self._find("calib_velo_to_cam.txt"), self._find("calib_cam_to_cam.txt")
        if lidar is None or camera is None:
            text = f"{self.path}: no calib_velo_to_cam.txt and calib_cam_to_cam.txt here or in the folder above"
            return None, (Problem("no calibration", f"{text}; the camera is not used"),)
        entries = read_keyed_numbers(camera)
        rectified = matrix(entries, camera, "R_rect_00") @ matrix(read_keyed_numbers(lidar), lidar, "R", "T")
        return rectified_camera(matrix(entries, camera, "P_rect_02"), rectified, camera.parent), ()

    def _read_ground_truth(self, start: np.datetime64 | None) -> tuple[Array | None, tuple[Problem, ...]]:
        files = files_by_number(self.path / "oxts" / "data", (".txt",))
        calibration = self._find("calib_imu_to_velo.txt")
        if len(files) < 2:
            return None, ()
        if calibration is None:
            text = f"{self.path / 'oxts'}: not used: no calib_imu_to_velo.txt in {self.path} or the folder above"
            return None, (Problem("no ground truth", text),)
        T_lidar_imu = matrix(read_keyed_numbers(calibration), calibration, "R", "T")
        seconds = self._packet_seconds(np.array(list(files)), start)
        poses = oxts.imu_poses(oxts.read_packets(list(files.values()))) @ se3.inverse(T_lidar_imu)
        # In some drives the stamps of packets repeat or run backwards.
        rising = np.concatenate([[True], seconds[1:] > np.maximum.accumulate(seconds)[:-1]])
        truth = oxts.poses_at(seconds[rising], poses[rising], self.stamps)
        lost = int(np.isnan(truth[:, 0, 0]).sum())
        text = f"{self.path / 'oxts'}: no packet near {lost} of {len(truth)} scans; these have no ground truth"
        return se3.from_first(truth), (Problem("no ground truth", text),) if lost else ()

    def _packet_seconds(self, numbers: Array, start: np.datetime64 | None) -> Array:
        """Return the times (M,) of OXTS packets since the first scan [s]; by their numbers if there is no clock."""
        path = self.path / "oxts" / "timestamps.txt"
        clock = None if start is None else _read_clock(path)
        if clock is None:  # synchronised drives have one packet per scan
            return self.scan_period * (numbers - self.numbers[0])
        return np.asarray((rows_by_number(clock, numbers, path) - start) / np.timedelta64(1, "s"))


def _read_clock(path: Path) -> Array | None:
    """Read KITTI's timestamps.txt: (N,) datetime64[ns], NaT for empty lines; None if there is no such file.

    Raises:
        InputError: A line is neither empty nor a date and time.
    """
    return clock_rows(path, text_lines(path)) if path.exists() else None
