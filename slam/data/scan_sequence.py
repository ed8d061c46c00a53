"""Base class of loaders for sequences with one file per scan."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from slam.data.cloud import Array, Calibration, Frame, View
from slam.data.conventions import Conventions
from slam.data.files import SCAN_PERIOD, gaps
from slam.data.ground_truth import GroundTruth
from slam.data.images import ImageFile, image_problems, matched_images, no_image
from slam.data.point_files import Points, Reading, read_points
from slam.data.problem import Problem
from slam.data.scan_columns import SAMPLES, find_columns
from slam.data.scan_names import ScanNames
from slam.data.sensor import Sensor
from slam.data.stamps import usual_step

EXAMINED = 3 * SAMPLES  # scans at most, to find SAMPLES of them with points


class ScanSequence:
    """A sequence with one file per scan. See `Dataset` for the properties.

    The meaning of intensities, rings and times is estimated once, from the first scans. A loader passes the files,
    their reading and their stamps, then adds ground truth and cameras.

    Args:
        path: Folder of the sequence.
        name: Name for tables and run.json.
        scans: The files with their numbers and, if known, their stamps.
        stamps_from: Source of the stamps.
        reading: Reading of the files.
        sensor: The LiDAR, None if the sensor model is unknown.
        said: Conventions of stamps and fields that are known.
        compensated: The scans are motion-compensated, whatever the sensor model says.
        no_stamps: Reason why there are no stamps, for the message.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        scans: ScanNames,
        stamps_from: str,
        reading: Reading,
        sensor: Sensor | None,
        said: Conventions,
        *,
        compensated: bool = False,
        no_stamps: str = "no stamps",
    ) -> None:
        self.path, self.name = path, name
        self._files, self.numbers = scans.files, scans.numbers
        self.reading, self.sensor = reading, sensor
        period = None if scans.stamps is None else usual_step(scans.stamps)
        first = self._first_scans(scans.stamps)
        self._columns = find_columns(first, sensor, said, period, self._files[0], compensated)
        self.point_times, self.rings = self._columns.times, self._columns.rings
        step = max(int(np.median(np.diff(self.numbers))), 1) if len(self) > 1 else 1
        self.problems = (*gaps(self.numbers, self._files[0].parent, step), *self._columns.problems)
        self.known_times = scans.stamps is not None
        self.stamps_from = stamps_from if self.known_times else "assumed"
        self.stamps: Array = self._assumed_stamps(step, no_stamps) if scans.stamps is None else scans.stamps
        self.calibration: Calibration | None = None
        self.ground_truth: Array | None = None
        self.truth_readings: Mapping[str, Array] = {}
        self._image_folder: Path | None = None
        self._images: list[ImageFile | None] = [None] * len(self)
        self._other_cameras: list[tuple[Calibration, Path, list[ImageFile | None]]] = []

    def __len__(self) -> int:
        return len(self._files)

    @property
    def images(self) -> tuple[Path | None, ...]:
        """The file of each scan's image, or None."""
        return tuple(None if image is None else image.path for image in self._images)

    @property
    def folders(self) -> tuple[Path, ...]:
        """The folders that the sequence is read from: nothing may be written there."""
        images = () if self._image_folder is None else (self._image_folder,)
        return (self.path, self._files[0].parent, *images, *(folder for _, folder, _ in self._other_cameras))

    def __getitem__(self, position: int) -> Frame:
        number = int(self.numbers[position])
        points = self.points(position)
        cloud, odd = self._columns.cloud(points, float(self.stamps[position]), self._files[position])
        problems = points.problems + odd
        if self._image_folder is not None:
            problems += image_problems(self._images[position], number, self._image_folder)
        for _, folder, images in self._other_cameras:
            problems += image_problems(images[position], number, folder)
        return Frame(
            index=number,
            stamp=float(self.stamps[position]),
            cloud=cloud,
            calibration=self.calibration,
            read_image=self._images[position] or no_image,
            problems=problems,
            others=tuple(View(camera, images[position] or no_image) for camera, _, images in self._other_cameras),
        )

    def points(self, position: int) -> Points:
        """Read a scan as its file contains it, x forward, y left, z up."""
        return read_points(self._files[position], self.reading)

    def note(self, *problems: Problem) -> None:
        """Add problems of the sequence as a whole."""
        self.problems = (*self.problems, *problems)

    def take_truth(self, truth: GroundTruth) -> None:
        """Set the ground truth, and add its problems."""
        self.ground_truth, self.truth_readings = truth.poses, truth.readings
        self.note(*truth.problems)

    def take_images(self, folder: Path | None, unit: str | None = None) -> None:
        """Match the images of a folder with the scans (see `matched_images`), if the folder exists."""
        if folder is not None and folder.is_dir():
            found = matched_images(folder, self._files, self.stamps, self.known_times, unit)
            self._image_folder, self._images, unmatched = found
            self.note(*unmatched)

    def take_other_camera(self, calibration: Calibration, folder: Path) -> None:
        """Add a further camera, and match its images with the scans."""
        place, images, unmatched = matched_images(folder, self._files, self.stamps, self.known_times)
        self.note(*unmatched)
        if place is not None:
            self._other_cameras.append((calibration, place, images))

    def _first_scans(self, stamps: Array | None) -> list[tuple[Points, float | None]]:
        """Read the first scans with points, with their stamps if these were recorded."""
        found: list[tuple[Points, float | None]] = []
        for position in range(min(len(self), EXAMINED)):
            points = self.points(position)
            if len(points.xyz):
                found.append((points, None if stamps is None else float(stamps[position])))
            if len(found) == SAMPLES:
                break
        return found

    def _assumed_stamps(self, step: int, no_stamps: str) -> Array:
        """Return evenly spaced stamps: with the period of the points' times, else SCAN_PERIOD."""
        times = self.point_times
        period = (times.period or times.sweep) if times.field else SCAN_PERIOD
        counted = self.numbers - self.numbers[0] if step == 1 else np.arange(len(self))
        why = f"as in field {times.field}" if times.field else "assumed"
        text = f"{self.path}: {no_stamps}; {1 / period:.3g} scans a second {why}"
        self.note(Problem("no time stamps", text))
        return np.asarray(counted * period)
