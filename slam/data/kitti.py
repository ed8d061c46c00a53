"""Common part of the loaders for KITTI's odometry benchmark and for its raw drives."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.beams import rings_in_file_order, turn_times
from slam.data.calibration_file import is_rigid
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.files import SCAN_PERIOD, files_by_number
from slam.data.first_scans import reading_of
from slam.data.images import IMAGE_SUFFIXES, ImageFile, image_problems, no_image
from slam.data.point_files import Points, read_points
from slam.data.point_times import PointTimes, azimuth_times
from slam.data.problem import Problem
from slam.data.sensor import Sensor, is_sensor_file
from slam.data.stamps import usual_step

KITTIS = "hdl64"  # KITTI's LiDAR


class KittiSequence:
    """Scans stored ring after ring, top ring first, with the colour camera's images of the same numbers.

    The loaders add stamps, calibration and ground truth. See `Dataset` for the properties.

    Args:
        path: Folder of the sequence.
        sensor: The LiDAR.
        override: The user's sensor model, which replaces that of the folder; None without one.
        stamp: Instant of the sweep that the stamps refer to. Default: the middle.
        scans: Folder of the scans.
        images: Folder of the images.

    Attributes:
        scan_period: Time between consecutive scans, and duration of a sweep [s].
        stamps_from: Source of the stamps, for people.

    Raises:
        InputError: There are no scans.
    """

    stamps: Array
    stamps_from = "assumed"
    scan_period = SCAN_PERIOD
    calibration: Calibration | None

    def __init__(
        self, path: Path, sensor: Sensor, override: str | Path | None, stamp: str | None, scans: Path, images: Path
    ) -> None:
        self.path, self.sensor, self._stamp = path, sensor, stamp or "middle"
        self._scans = files_by_number(scans, (".bin",))
        if not self._scans:
            raise InputError(f"{scans}: no scans in it; KITTI's are numbered .bin files, like 000000.bin")
        self._reading, self._told = reading_of(list(self._scans.values()))
        self._told += _motion_assumed(path, sensor, override)
        self._image_folder, self._images = images, files_by_number(images, IMAGE_SUFFIXES)
        self.numbers = np.array(list(self._scans), np.int64)

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def point_times(self) -> PointTimes:
        """Times of the points: none for motion-compensated scans, by the azimuth for others."""
        if not self.sensor.motion_compensated:
            return azimuth_times(self.scan_period, self._stamp)
        return PointTimes(why="the scans are motion-compensated already", sweep=self.scan_period, stamp=self._stamp)

    def _has_stamps(self, every: Array, unit: str) -> None:
        """Set the scan period from the times (M,) [s] of all frames in their file, and the source of the stamps."""
        self.scan_period, self.stamps_from = usual_step(every) or SCAN_PERIOD, unit

    @property
    def images(self) -> tuple[Path | None, ...]:
        """The file of each scan's image, or None."""
        return tuple(self._images.get(int(number)) for number in self.numbers)

    @property
    def folders(self) -> tuple[Path, ...]:
        """The folders that the sequence is read from: nothing may be written there."""
        return (self.path, next(iter(self._scans.values())).parent, self._image_folder)

    def points(self, position: int) -> Points:
        """Read a scan as its file contains it."""
        return read_points(self._scans[int(self.numbers[position])], self._reading)

    def __getitem__(self, position: int) -> Frame:
        number = int(self.numbers[position])
        points = self.points(position)
        xyz, problems = points.xyz, points.problems
        intensity = np.zeros(len(xyz)) if points.intensity is None else np.nan_to_num(points.intensity)
        ring, odd = rings_in_file_order(xyz, self.sensor, self._scans[number])
        time = None if self.sensor.motion_compensated else turn_times(xyz, self.scan_period, self._stamp)
        image = ImageFile(self._images[number]) if number in self._images else None
        if self._images:
            problems += image_problems(image, number, self._image_folder)
        return Frame(
            index=number,
            stamp=float(self.stamps[position]),
            cloud=PointCloud(xyz, intensity, ring, time),
            calibration=self.calibration,
            read_image=image or no_image,
            problems=problems + odd,
        )


def _motion_assumed(path: Path, sensor: Sensor, override: str | Path | None) -> tuple[Problem, ...]:
    """Report that scans of another LiDAR are assumed to have KITTI's sweep, if nothing says how they were swept."""
    if override is None or sensor.name == KITTIS or is_sensor_file(override) or (path / "sensor.yaml").is_file():
        return ()
    how = "swept from the rear, with the stamp in the middle of the sweep"
    how = "motion-compensated" if sensor.motion_compensated else how
    other = str(not sensor.motion_compensated).lower()
    text = f"{path}: scans of a {sensor.name} are assumed to be {how}, as KITTI's are; if they are not, give --sensor"
    return (Problem("motion assumed", f"{text} a file with 'model: {sensor.name}' and 'motion_compensated: {other}'"),)


def rectified_camera(P: Array, T_camera0_lidar: Array, source: object = "the calibration") -> Calibration:
    """Create the calibration of KITTI's colour camera.

    Args:
        P: Projection matrix (4, 4), last row 0 0 0 1, of points in rectified camera 0: [K | K t].
        T_camera0_lidar: Pose (4, 4) of the LiDAR in rectified camera 0.
        source: The file, for errors.

    Raises:
        InputError: The focal lengths are not positive, or the pose is not a rotation and a translation.
    """
    if not (np.isfinite(P).all() and P[0, 0] > 0 and P[1, 1] > 0 and P[2, 2] != 0):
        raise InputError(f"{source}: the projection matrix of camera 2 has no positive focal lengths; repair it")
    if not is_rigid(T_camera0_lidar):
        raise InputError(
            f"{source}: the pose of the LiDAR in camera 0 is not a rotation and a translation (a reflection, another "
            "scale, or a number that is not finite); repair it, or remove the file to run without the camera"
        )
    T_camera_camera0 = np.eye(4)
    T_camera_camera0[:3, 3] = np.linalg.solve(P[:3, :3], P[:3, 3])
    return Calibration(P[:3, :3].copy(), T_camera_camera0 @ T_camera0_lidar, (), T_camera0_lidar)
