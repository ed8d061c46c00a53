"""A folder of scans of a user's own, with whatever lies beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.calibration_file import read_calibration
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.files import SCAN_PERIOD, gaps
from slam.data.first_scans import reading_of
from slam.data.ground_truth import read_ground_truth
from slam.data.images import image_folder, image_problems, match_images, no_image
from slam.data.point_files import SUFFIXES, Points, read_points
from slam.data.problem import Problem
from slam.data.scan_columns import SAMPLES, Columns, find_columns
from slam.data.scan_names import ScanNames, named_scans
from slam.data.sensor import Sensor, conventions_of_folder, sensor_of_folder
from slam.data.stamps import mended, usual_step
from slam.data.time_files import TIME_FILES, read_stamps

LOOKED_AT = 3 * SAMPLES  # scans at most, for as many as are needed with points


class UserFolder:
    """Scans (.bin of float32 x y z intensity, .pcd, .ply, .npy) in the folder or its scans/, velodyne/ or points/.

    Optional beside them: `times.txt` or `timestamps.txt` (see `read_stamps`; else names that are stamps tell),
    `images/` or `image_2/` (matched by their own times.txt, else by name), `calib.yaml` (see `read_calibration`),
    `poses.txt` (KITTI or TUM, of the LiDAR at the stamps), `sensor.yaml` (see `load_sensor`, `Conventions`). What
    intensities, rings and points' times mean is found from the first scans, once for all. Rings come from the file's
    field, else from the sensor's laser lines. See `Dataset` for the fields. Raises InputError where a file holds
    something else than it should.

    Args:
        path: The folder.
        sensor: Overrides what sensor.yaml says of the LiDAR.
        columns: Of .bin and .npy files (see `reading_of`). By default their numbers tell.
        stamp: The instant of a sweep that stamps belong to, 'start', 'middle' or 'end'. By default the points' times
            tell.
        point_time: The field with the points' times, FIELD or FIELD:UNIT. By default the first that can have them.
    """

    LAYOUT = "scans (.bin, .pcd, .ply, .npy) in the folder itself or in its scans/, velodyne/ or points/"

    @staticmethod
    def drives(path: Path) -> dict[str, Path]:
        """The folder itself where it has scans. See `Loader`."""
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
        self.path = path
        self.name = path.resolve().name
        scans = named_scans(path)
        self._files, self.numbers = scans.files, scans.numbers
        kinds = sorted({file.suffix.lower() for file in self._files})
        if len(kinds) != 1:
            fault = f"scans of several kinds ({', '.join(kinds)}); keep one" if kinds else "no scans in it"
            raise InputError(f"{path}: {fault}; {', '.join(SUFFIXES)} files are read")
        self.reading, told = reading_of(self._files, columns)
        self.sensor = sensor_of_folder(path, sensor)
        said = conventions_of_folder(path, sensor).said(stamp, point_time)
        step = max(int(np.median(np.diff(self.numbers))), 1) if len(self) > 1 else 1
        recorded, self.stamps_from, unusual = self._read_stamps(scans)
        period = None if recorded is None else usual_step(recorded)
        self._columns = find_columns(self._first_scans(recorded), self.sensor, said, period, self._files[0])
        self.point_times = self._columns.times
        slow: tuple[Problem, ...] = ()
        if recorded is None:
            recorded, slow = self._assumed_stamps(step)
        self.stamps = recorded
        self.calibration, uncalibrated = self._read_calibration()
        self._image_folder, self._images, unmatched = match_images(path, self._files, self.stamps, known_times=not slow)
        truth = read_ground_truth(path, self.stamps, self.numbers, known_times=not slow)
        self.ground_truth, self.truth_readings = truth.poses, truth.readings
        beside = (*uncalibrated, *unmatched, *truth.problems)
        missing = gaps(self.numbers, self._files[0].parent, step)
        self.problems = (*told, *missing, *unusual, *slow, *self._columns.problems, *beside)

    def __len__(self) -> int:
        return len(self._files)

    @property
    def images(self) -> tuple[Path | None, ...]:
        """Of each scan its image's file, or None."""
        return tuple(None if image is None else image.path for image in self._images)

    @property
    def folders(self) -> tuple[Path, ...]:
        """What the drive is read from: nothing may be written there."""
        images = () if self._image_folder is None else (self._image_folder,)
        return (self.path, self._files[0].parent, *images)

    def __getitem__(self, position: int) -> Frame:
        number = int(self.numbers[position])
        points = self.points(position)
        cloud, odd = self._columns.cloud(points, float(self.stamps[position]), self._files[position])
        problems = points.problems + odd
        if self._image_folder is not None:
            problems += image_problems(self._images[position], number, self._image_folder)
        return Frame(
            index=number,
            stamp=float(self.stamps[position]),
            cloud=cloud,
            calibration=self.calibration,
            read_image=self._images[position] or no_image,
            problems=problems,
        )

    def points(self, position: int) -> Points:
        """A scan as its file has it."""
        return read_points(self._files[position], self.reading)

    def _first_scans(self, stamps: Array | None) -> list[tuple[Points, float | None]]:
        """Those with points, and their stamps where they were recorded."""
        found: list[tuple[Points, float | None]] = []
        for position in range(min(len(self), LOOKED_AT)):
            points = self.points(position)
            if len(points.xyz):
                found.append((points, None if stamps is None else float(stamps[position])))
            if len(found) == SAMPLES:
                break
        return found

    def _read_stamps(self, scans: ScanNames) -> tuple[Array | None, str, tuple[Problem, ...]]:
        """Stamps (N,) of a file or of the names, where they are from, and what is wrong with them; None where there are
        none."""
        places = [folder / name for folder in (self.path, self._files[0].parent) for name in TIME_FILES]
        path = next((place for place in places if place.is_file()), None)
        problems: tuple[Problem, ...] = ()
        if path is not None:
            found = read_stamps(path, self._files, self.numbers)
            if found is not None:
                return found.seconds, f"{path.name}, {found.unit}", found.problems
            problems = (Problem("no time stamps", f"{path}: all of its times are the same; they are left out"),)
        if scans.stamps is not None and (usual_step(scans.stamps) is not None or len(self) == 1):
            stamps, repaired = mended(scans.stamps, f"{self.path}: names")
            return stamps, f"the scans' names, {scans.unit}", (*problems, *repaired)
        return None, "assumed", problems

    def _assumed_stamps(self, step: int) -> tuple[Array, tuple[Problem, ...]]:
        """Of scans that are evenly spaced: as the points' times have it, else at SCAN_PERIOD."""
        times = self.point_times
        period = (times.period or times.sweep) if times.field else SCAN_PERIOD
        counted = self.numbers - self.numbers[0] if step == 1 else np.arange(len(self))
        why = f"as field {times.field} has it" if times.field else "assumed"
        text = f"{self.path}: no times.txt; {1 / period:.3g} scans a second {why}"
        return counted * period, (Problem("no time stamps", text),)

    def _read_calibration(self) -> tuple[Calibration | None, tuple[Problem, ...]]:
        if (self.path / "calib.yaml").is_file():
            return read_calibration(self.path / "calib.yaml"), ()
        if image_folder(self.path):
            text = f"{self.path}: images, but no calib.yaml (K, T_camera_lidar); the camera is not used"
            return None, (Problem("no calibration", text),)
        return None, ()


def to_cloud(points: Points, sensor: Sensor | None, path: Path) -> PointCloud:
    """A single scan in our units: intensity 0..1, ring 0 on top, times in seconds from its stamp, its columns taken for
    what they look like in it. Of a drive, `find_columns` decides once; `path` names the scan in messages."""
    columns: Columns = find_columns([(points, None)], sensor, where=path)
    return columns.cloud(points, 0.0, path)[0]
