"""A folder of scans of a user's own, with whatever lies beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.beams import nearest_rings, recover_rings
from slam.data.calibration_file import read_calibration
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.files import (
    SCAN_PERIOD,
    gaps,
    natural_key,
    numbers_of,
    read_times,
)
from slam.data.ground_truth import read_ground_truth
from slam.data.images import image_folder, image_problems, match_images, no_image
from slam.data.point_files import SUFFIXES, Points, read_points
from slam.data.problem import Problem
from slam.data.sensor import Sensor, sensor_of_folder


class UserFolder:
    """Scans (.bin of float32 x y z intensity, .pcd, .ply, .npy) in the folder or its scans/, velodyne/ or points/.

    Optional beside them: `times.txt` or `timestamps.txt` (seconds, one a line), `images/` or `image_2/` (matched by
    their own times.txt, else by name), `calib.yaml` (see `read_calibration`), `poses.txt` (KITTI or TUM, of the
    LiDAR), `sensor.yaml` (see `load_sensor`). Rings come from the file's field, else from the sensor's laser lines.
    See `Dataset` for the fields. Raises InputError where a file holds something else than it should.
    """

    LAYOUT = "scans (.bin, .pcd, .ply, .npy) in the folder itself or in its scans/, velodyne/ or points/"

    @staticmethod
    def drives(path: Path) -> dict[str, Path]:
        """The folder itself where it has scans. See `Loader`."""
        return {"": path} if scans_in(path) else {}

    def __init__(self, path: Path, sensor: str | Path | None = None) -> None:
        self.path = path
        self.name = path.resolve().name
        self._files = scans_in(path)
        kinds = sorted({file.suffix.lower() for file in self._files})
        if len(kinds) != 1:
            fault = f"scans of several kinds ({', '.join(kinds)}); keep one" if kinds else "no scans in it"
            raise InputError(f"{path}: {fault}; {', '.join(SUFFIXES)} files are read")
        self.sensor = sensor_of_folder(path, sensor)
        self.numbers = numbers_of(self._files)
        step = max(int(np.median(np.diff(self.numbers))), 1) if len(self) > 1 else 1
        self.stamps, slow = self._read_stamps(step)
        self.calibration, uncalibrated = self._read_calibration()
        self._image_folder, self._images, unmatched = match_images(path, self._files, self.stamps, known_times=not slow)
        truth = read_ground_truth(path, self.stamps, self.numbers, known_times=not slow)
        self.ground_truth, self.truth_readings = truth.poses, truth.readings
        self.problems = (
            *gaps(self.numbers, self._files[0].parent, step),
            *slow,
            *uncalibrated,
            *unmatched,
            *truth.problems,
        )

    def __len__(self) -> int:
        return len(self._files)

    @property
    def folders(self) -> tuple[Path, ...]:
        """What the drive is read from: nothing may be written there."""
        images = () if self._image_folder is None else (self._image_folder,)
        return (self.path, self._files[0].parent, *images)

    def __getitem__(self, position: int) -> Frame:
        number = int(self.numbers[position])
        points = read_points(self._files[position])
        problems = points.problems
        if self._image_folder is not None:
            problems += image_problems(self._images[position], number, self._image_folder)
        return Frame(
            index=number,
            stamp=float(self.stamps[position]),
            cloud=to_cloud(points, self.sensor, self._files[position]),
            calibration=self.calibration,
            read_image=self._images[position] or no_image,
            problems=problems,
        )

    def _read_stamps(self, step: int) -> tuple[Array, tuple[Problem, ...]]:
        places = [folder / name for folder in (self.path, self._files[0].parent) for name in TIME_FILES]
        path = next((place for place in places if place.is_file()), None)
        if path is not None:
            return read_times(path, self.numbers), ()
        counted = self.numbers - self.numbers[0] if step == 1 else np.arange(len(self))
        text = f"{self.path}: no times.txt; {1 / SCAN_PERIOD:g} scans a second assumed"
        return counted * SCAN_PERIOD, (Problem("no time stamps", text),)

    def _read_calibration(self) -> tuple[Calibration | None, tuple[Problem, ...]]:
        if (self.path / "calib.yaml").is_file():
            return read_calibration(self.path / "calib.yaml"), ()
        if image_folder(self.path):
            text = f"{self.path}: images, but no calib.yaml (K, T_camera_lidar); the camera is not used"
            return None, (Problem("no calibration", text),)
        return None, ()


SCAN_FOLDERS = ("scans", "velodyne", "points", ".")
TIME_FILES = ("times.txt", "timestamps.txt")


def scans_in(path: Path) -> list[Path]:
    """The scan files of a folder, in the order of the numbers in their names; empty where there are none."""
    for folder in (path / name for name in SCAN_FOLDERS):
        if folder.is_dir():
            files = [file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES]
            if files:
                return sorted(files, key=natural_key)
    return []


def to_cloud(points: Points, sensor: Sensor | None, path: Path) -> PointCloud:
    """Points as a file has them in our units: intensity 0..1, ring 0 on top, time as a fraction of the sweep."""
    found = points.intensity if points.intensity is not None else np.zeros(len(points.xyz))
    intensity = np.nan_to_num(found.astype(np.float64))
    if len(intensity) and intensity.max() > 1:  # Velodyne and most others: 0..255
        intensity = np.clip(intensity / 255, 0, 1)
    time = points.time
    if time is not None and len(time):
        time = (time - time.min()).astype(np.float64)
        time = time / time.max() if 0 < time.max() < np.inf else None
    if sensor is not None and sensor.motion_compensated:
        time = None
    return PointCloud(points.xyz, intensity, _rings(points, sensor, path), time)


def _rings(points: Points, sensor: Sensor | None, path: Path) -> Array | None:
    if len(points.xyz) == 0 or (points.ring is None and sensor is None):
        return None
    if points.ring is None:
        assert sensor is not None
        return rings_by_lines(points.xyz, sensor)
    ring = points.ring.astype(np.int64)
    highest = int(ring.max())
    if int(ring.min()) < 0 or highest >= (sensor.ring_count if sensor else 1024):
        limit = f"the sensor {sensor.name} has {sensor.ring_count}" if sensor else "0 to 1023 make sense"
        raise InputError(f"{path}: rings {int(ring.min())} to {highest}, but {limit}; name the right one with --sensor")
    # Velodyne's drivers count from the bottom. Without a sensor the next power of two stands for its rings, since the
    # uppermost ones often see nothing but sky.
    count = sensor.ring_count if sensor else max(16, 1 << highest.bit_length())
    slope = points.xyz[:, 2] / np.maximum(np.hypot(points.xyz[:, 0], points.xyz[:, 1]), 1e-3)
    upwards = np.mean((ring - ring.mean()) * (slope - slope.mean())) > 0
    return count - 1 - ring if upwards else ring


def rings_by_lines(xyz: Array, sensor: Sensor) -> Array:
    """(N,): the nearest laser line's ring; by wraparound where the file is stored ring after ring, as KITTI's are,
    which holds for motion-compensated points too."""
    lines = nearest_rings(xyz, sensor)
    ring, found = recover_rings(xyz)
    in_order = found == sensor.ring_count and np.mean(np.abs(ring - lines) <= 1) > 0.5
    return ring if in_order else lines
