"""A folder of scans, with the optional files beside them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from slam.data.calibration_file import read_cameras
from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.data.first_scans import reading_of
from slam.data.ground_truth import read_ground_truth
from slam.data.images import image_folder
from slam.data.point_files import SUFFIXES, Points
from slam.data.problem import Problem
from slam.data.scan_columns import Columns, find_columns
from slam.data.scan_names import ScanNames, named_scans, stamps_of_names
from slam.data.scan_sequence import ScanSequence
from slam.data.sensor import Sensor, conventions_of_folder, sensor_of_folder
from slam.data.time_files import TIME_FILES, read_stamps


class UserFolder(ScanSequence):
    """Scans (.bin, .pcd, .ply, .npy, .las, .laz) in the folder or its scans/, velodyne/, points/ or lidar/.

    Optional files in the folder: `times.txt` or `timestamps.txt` (see `read_stamps`; without them, file names that are
    stamps), `images/` or `image_2/` (matched by their own times.txt, else by name), `calib.yaml` (see `read_cameras`),
    `poses.txt` (KITTI or TUM, of the LiDAR at the stamps), `sensor.yaml` (see `load_sensor`, `Conventions`). See
    `Dataset` for the properties.

    The meaning of intensities, rings and times is estimated once, from the first scans. Rings are those of the file, or
    follow from the sensor's laser lines.

    Args:
        path: The folder.
        sensor: Overrides the sensor model of sensor.yaml.
        columns: Columns of .bin and .npy files (see `reading_of`). Default: estimated from the values.
        stamp: Instant of the sweep that the stamps refer to, 'start', 'middle' or 'end'. Default: as the points' times
            say.
        point_time: Field with the points' times, FIELD or FIELD:UNIT. Default: the first field that can be times.

    Raises:
        InputError: There are no scans, or scans of several kinds; or a file has an unexpected content.
    """

    LAYOUT = f"scans ({', '.join(SUFFIXES)}) in the folder itself or in its scans/, velodyne/, points/ or lidar/"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Return the folder itself if it has scans. See `Loader`."""
        return {"": path} if named_scans(path).files else {}

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        columns: str | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        scans = named_scans(path)
        kinds = sorted({file.suffix.lower() for file in scans.files})
        if len(kinds) != 1:
            fault = f"scans of several kinds ({', '.join(kinds)}); keep one" if kinds else "no scans in it"
            raise InputError(f"{path}: {fault}; {', '.join(SUFFIXES)} files are read")
        reading, told = reading_of(scans.files, columns)
        lasers = sensor_of_folder(path, sensor)
        said = conventions_of_folder(path, sensor).said(stamp, point_time)
        file = _times_file(path, scans)
        stamps, stamps_from, unusual = _read_stamps(path, file, scans)
        scans = replace(scans, stamps=stamps)
        without = "no times.txt" if file is None else f"all times in {file.name} are the same"
        super().__init__(path, path.resolve().name, scans, stamps_from, reading, lasers, said, no_stamps=without)
        self.problems = (*told, *unusual, *self.problems)
        self._take_cameras()
        self.take_truth(read_ground_truth(path, self.stamps, self.numbers, self.known_times))

    def _take_cameras(self) -> None:
        """Read the cameras of calib.yaml: the first one with images is that of the frames, the others colour points."""
        usual, file = image_folder(self.path), self.path / "calib.yaml"
        if not file.is_file():
            if usual is not None:
                text = f"{self.path}: images, but no calib.yaml (K, T_camera_lidar); the camera is not used"
                self.note(Problem("no calibration", text))
            self.take_images(usual)
            return
        for camera in read_cameras(file):
            folder = camera.images or usual
            if camera.images is not None and not camera.images.is_dir():
                self.note(Problem("no images", f"{camera.images}: no such folder; this camera is not used"))
            elif self.calibration is None:
                self.calibration = camera.calibration
                self.take_images(folder)
            elif folder is not None:
                self.take_other_camera(camera.calibration, folder)


def _times_file(path: Path, scans: ScanNames) -> Path | None:
    places = [folder / name for folder in (path, scans.files[0].parent) for name in TIME_FILES]
    return next((place for place in places if place.is_file()), None)


def _read_stamps(path: Path, file: Path | None, scans: ScanNames) -> tuple[Array | None, str, tuple[Problem, ...]]:
    """Read stamps (N,) from the file or the names: stamps, their source, and problems.

    The stamps are None if there are none, or if all times in the file are the same.
    """
    if file is not None and (found := read_stamps(file, scans.files, scans.numbers)) is not None:
        return found.seconds, f"{file.name}, {found.unit}", found.problems
    return stamps_of_names(path, scans)


def to_cloud(points: Points, sensor: Sensor | None, path: Path) -> PointCloud:
    """Convert a single scan: intensity 0..1, ring 0 on top, times in seconds from its stamp.

    The meaning of its columns is estimated from this scan alone; for a sequence, `find_columns` does so once.

    Args:
        points: The scan.
        sensor: The LiDAR, None if the sensor model is unknown.
        path: Name of the scan in messages.
    """
    columns: Columns = find_columns([(points, None)], sensor, where=path)
    return columns.cloud(points, 0.0, path)[0]
