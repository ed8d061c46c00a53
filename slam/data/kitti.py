"""What KITTI's odometry benchmark and its raw drives have in common."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.beams import rings_in_file_order, sweep_fraction
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.files import files_by_number, read_bin
from slam.data.images import IMAGE_SUFFIXES, ImageFile, image_problems, no_image
from slam.data.sensor import Sensor


class KittiDrive:
    """Scans stored ring after ring, top ring first, with the colour camera's images of the same numbers.

    The loaders add stamps, calibration and ground truth. See `Dataset` for the fields.
    """

    stamps: Array
    calibration: Calibration | None

    def __init__(self, path: Path, sensor: Sensor, scans: Path, images: Path) -> None:
        self.path, self.sensor = path, sensor
        self._scans = files_by_number(scans, (".bin",))
        if not self._scans:
            raise InputError(f"{scans}: no scans in it; KITTI's are numbered .bin files, like 000000.bin")
        self._image_folder, self._images = images, files_by_number(images, IMAGE_SUFFIXES)
        self.numbers = np.array(list(self._scans), np.int64)

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def folders(self) -> tuple[Path, ...]:
        """What the drive is read from: nothing may be written there."""
        return (self.path, next(iter(self._scans.values())).parent, self._image_folder)

    def __getitem__(self, position: int) -> Frame:
        number = int(self.numbers[position])
        xyz, intensity, problems = read_bin(self._scans[number])
        ring, odd = rings_in_file_order(xyz, self.sensor, self._scans[number])
        time = None if self.sensor.motion_compensated else sweep_fraction(xyz)
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


def rectified_camera(P: Array, T_camera0_lidar: Array) -> Calibration:
    """KITTI's colour camera from its projection matrix P (4, 4, last row 0 0 0 1) = [K | K t] of rectified camera 0."""
    T_camera_camera0 = np.eye(4)
    T_camera_camera0[:3, 3] = np.linalg.solve(P[:3, :3], P[:3, 3])
    return Calibration(P[:3, :3].copy(), T_camera_camera0 @ T_camera0_lidar, (), T_camera0_lidar)
