"""Meaning of the columns of scans (intensities, rings, times), estimated once per sequence from its first scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.data.conventions import Conventions
from slam.data.errors import InputError
from slam.data.point_files import Points
from slam.data.point_times import PointTimes, Sample, find_point_times
from slam.data.problem import Problem
from slam.data.scan_rings import MANY, ring_numbers, rings_by_lines, rings_of_numbers, wrong_lines
from slam.data.sensor import Sensor, nominal_lines

SAMPLES = 8  # scans with points that are examined
USUAL_INTENSITY = 255.0  # largest value of most drivers
BRIGHT = 99.0  # percentile of the intensities that becomes 1, if values exceed USUAL_INTENSITY


@dataclass(frozen=True, eq=False)
class Columns:
    """Conversion of the columns of a sequence's scans into the fields of a `PointCloud`.

    Attributes:
        times: Interpretation of the points' times.
        full_intensity: Value in the files that becomes the intensity 1.
        ring_of: (K,) the ring, 0 on top, of each ring number in the files, -1 for an impossible number; None if the
            files have no rings.
        sensor: Laser lines of the LiDAR, None if the sensor model is unknown.
        rings: Number of rings, of the sensor or counted; None if the files have none.
        problems: Problems of the columns as a whole.
    """

    times: PointTimes = field(default_factory=PointTimes)
    full_intensity: float = USUAL_INTENSITY
    ring_of: Array | None = None
    sensor: Sensor | None = None
    rings: int | None = None
    problems: tuple[Problem, ...] = ()

    def cloud(self, points: Points, stamp: float, path: Path) -> tuple[PointCloud, tuple[Problem, ...]]:
        """Convert a scan.

        Args:
            points: The scan as its file contains it.
            stamp: Its time stamp [s].
            path: Its name in messages.

        Returns:
            The cloud, and problems of the scan's columns.
        """
        time, strays = self._time(points, stamp, path)
        ring, bad, odd = self._ring(points, path)
        cloud = PointCloud(points.xyz, self._intensity(points), ring, time)
        if bad is not None:
            cloud = cloud.select(~bad)
        return cloud, (*strays, *odd)

    def _intensity(self, points: Points) -> Array:
        if points.intensity is None:
            return np.zeros(len(points.xyz))
        return np.clip(np.nan_to_num(points.intensity.astype(np.float64)) / self.full_intensity, 0, 1)

    def _time(self, points: Points, stamp: float, path: Path) -> tuple[Array | None, tuple[Problem, ...]]:
        if not self.times.field or len(points.xyz) == 0:
            return None, ()
        values = points.times.get(self.times.field)
        found, missing = (None, len(points.xyz)) if values is None else self.times.seconds(values, stamp)
        if not missing:
            return found, ()
        count = f"{path}: {missing} of {len(points.xyz)} points have no time within the sweep"
        if found is None:
            return None, (Problem("no point times", f"{count}; the scan is not deskewed"),)
        return found, (Problem("stray point times", f"{count}; they take those of neighbouring points"),)

    def _ring(self, points: Points, path: Path) -> tuple[Array | None, Array | None, tuple[Problem, ...]]:
        """Return rings (N,) or None, the points to leave out (N,) bool or None, and problems."""
        if len(points.xyz) == 0:
            return None, None, ()
        if self.ring_of is None or points.ring is None:
            return (rings_by_lines(points.xyz, self.sensor) if self.sensor else None), None, ()
        ring = rings_of_numbers(points.ring, self.ring_of)
        bad = ring < 0
        if not bad.any():
            return ring, None, ()
        count = f"{path}: {bad.sum()} of {len(bad)} points have a ring that the sensor does not have"
        if bad.mean() <= MANY:
            return ring, bad, (Problem("ring unknown", f"{count}; they are left out"),)
        if self.sensor is None:
            return None, None, (Problem("ring unknown", f"{count}; the scan has none"),)
        lines = rings_by_lines(points.xyz, self.sensor)
        return lines, None, (Problem("ring unknown", f"{count}; rings follow from the laser lines instead"),)


def find_columns(
    scans: Sequence[tuple[Points, float | None]],
    sensor: Sensor | None = None,
    said: Conventions | None = None,
    period: float | None = None,
    where: object = "the scans",
    compensated: bool = False,
) -> Columns:
    """Estimate the meaning of the columns of a sequence.

    Args:
        scans: The first scans with their stamps [s], None if the stamps are unknown.
        sensor: The LiDAR, None if the sensor model is unknown.
        said: Conventions that the user states.
        period: Time between scans [s], None if unknown.
        where: Name of the sequence in messages.
        compensated: The scans are motion-compensated, whatever the sensor model says.

    Raises:
        InputError: The rings are not those of the sensor, or a field that the user names does not exist.
    """
    said = said or Conventions()
    scans = [(points, stamp) for points, stamp in scans if len(points.xyz)]
    try:
        times = find_point_times([Sample(points.times, points.xyz, stamp) for points, stamp in scans], period, said)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    if compensated or (sensor is not None and sensor.motion_compensated):
        times = PointTimes(why="the scans are motion-compensated already", sweep=times.sweep, stamp=times.stamp)
    found = [points for points, _ in scans]
    ring_of, problems = ring_numbers(found, sensor, where)
    rings = sensor.ring_count if sensor else None if ring_of is None else int(ring_of.max()) + 1
    if sensor and not (compensated or sensor.motion_compensated):
        problems += wrong_lines(found, ring_of, sensor, where)
    problems = (*nominal_lines(sensor), *problems)
    return Columns(times, said.full_intensity or _full_intensity(found), ring_of, sensor, rings, problems)


def _full_intensity(scans: Sequence[Points]) -> float:
    """Estimate the full intensity: 1, 255 (Velodyne and most others), or a high percentile of 16-bit values."""
    known = [points.intensity for points in scans if points.intensity is not None]
    if any(values.dtype == np.uint8 for values in known):
        return USUAL_INTENSITY
    values = np.concatenate([np.nan_to_num(values.astype(np.float64)) for values in known] or [np.zeros(1)])
    most = float(values.max())
    if most <= 1:
        return 1.0
    return USUAL_INTENSITY if most <= USUAL_INTENSITY else max(float(np.percentile(values, BRIGHT)), USUAL_INTENSITY)
