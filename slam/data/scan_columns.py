"""Meaning of the columns of scans (intensities, rings, times), estimated once per sequence from its first scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from slam.data.beams import nearest_rings, recover_rings
from slam.data.cloud import Array, PointCloud
from slam.data.conventions import Conventions
from slam.data.errors import InputError
from slam.data.point_files import Points
from slam.data.point_times import PointTimes, Sample, find_point_times
from slam.data.problem import Problem
from slam.data.sensor import Sensor

SAMPLES = 8  # scans with points that are examined
MOST_RINGS = 1024  # of an unknown sensor
COUNTS = (16, 32, 40, 64, 128)  # numbers of rings of LiDARs
MANY = 0.05  # share of the points; if more have an impossible ring, the field is no ring number at all
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
        number = _whole(points.ring, len(self.ring_of))
        ring = np.where(number < 0, -1, self.ring_of[number])
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
    ring_of, problems = _ring_numbers(found, sensor, where)
    rings = sensor.ring_count if sensor else None if ring_of is None else int(ring_of.max()) + 1
    return Columns(times, said.full_intensity or _full_intensity(found), ring_of, sensor, rings, problems)


def usual_rings(highest: int) -> int:
    """Return the number of rings of an existing LiDAR whose `highest` ring number seen, from 0, is given.

    The uppermost rings often have no returns, since they see the sky only.
    """
    return next((count for count in COUNTS if count > highest), 1 << highest.bit_length())


def rings_by_lines(xyz: Array, sensor: Sensor) -> Array:
    """Assign points to rings (N,) int16.

    For scans in KITTI's order the result is exact, also after motion compensation, which moves points off their laser
    lines; other points are assigned to the nearest line.
    """
    ring, found = recover_rings(xyz)
    return ring if found == sensor.ring_count else nearest_rings(xyz, sensor)


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


def _whole(ring: Array, count: int) -> Array:
    """Return ring numbers as (N,) int64, -1 for values that are not one of 0 .. count - 1."""
    with np.errstate(invalid="ignore"):
        sound = np.isfinite(ring) & (ring >= 0) & (ring < count) & (ring == np.floor(ring))
    return np.where(sound, np.where(sound, ring, 0).astype(np.int64), -1)


def _ring_numbers(
    scans: Sequence[Points], sensor: Sensor | None, where: object
) -> tuple[Array | None, tuple[Problem, ...]]:
    """Estimate the ring of each ring number in the files, (K,); None if the files have no rings."""
    found = [(points.xyz, _whole(points.ring, MOST_RINGS)) for points in scans if points.ring is not None]
    if not found:
        return None, ()
    lowest, highest = (int(np.median([edge(ring) for _, ring in found])) for edge in (np.min, np.max))
    from_one = lowest >= 1 and highest in ((sensor.ring_count,) if sensor else COUNTS)
    count = sensor.ring_count if sensor else usual_rings(max(highest - from_one, 0))
    wrong = [(ring - from_one < 0) | (ring - from_one >= count) for _, ring in found]
    if np.median([np.mean(each) for each in wrong]) > MANY:
        text = (
            f"{where}: rings {lowest} to {highest}" if highest >= 0 else f"{where}: its ring field has no ring numbers"
        )
        if sensor:
            limit = f"the sensor {sensor.name} has {count}"
            raise InputError(f"{text}, but {limit}; name the right one with --sensor")
        return None, (
            Problem("ring unknown", f"{text}, but only 0 to {MOST_RINGS - 1} are possible; the scans have no rings"),
        )
    sound = [(xyz[~bad], ring[~bad] - from_one) for (xyz, ring), bad in zip(found, wrong, strict=True)]
    xyz, numbers = (np.concatenate(column) for column in zip(*sound, strict=True))
    ring_of = _from_top(xyz, numbers, count, sensor)
    return np.concatenate([[-1], ring_of]) if from_one else ring_of, ()


def _from_top(xyz: Array, numbers: Array, count: int, sensor: Sensor | None) -> Array:
    """Estimate the ring (count,), 0 on top, of each number 0 .. count - 1.

    Velodyne's drivers count from the bottom, others from the top; numbers in the firing order of the lasers alternate.
    """
    slope = xyz[:, 2] / np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 1e-3)
    present = np.unique(numbers)
    heights = np.array([np.median(slope[numbers == number]) for number in present])
    down, up = np.arange(count), np.arange(count)[::-1]
    trend = float(np.mean((present - present.mean()) * (heights - heights.mean())))
    straight = up if trend > 0 else down
    order = present[np.argsort(-heights, kind="stable")]
    if len(present) < 4 or _share_in_order(straight[order]) > 0.8:
        return straight
    if sensor is None:
        return np.concatenate([order, np.setdiff1d(down, order)]).argsort()
    lines, fired = nearest_rings(xyz, sensor), np.full(count, -1)
    fired[present] = [np.bincount(lines[numbers == number], minlength=count).argmax() for number in present]
    unique = len(np.unique(fired[present])) == len(present)
    missing = np.setdiff1d(down, fired[present])
    fired[fired < 0] = missing[: int((fired < 0).sum())]
    return fired if unique else straight


def _share_in_order(rings: Array) -> float:
    """Return the share of consecutive rings that are in order, from the top down."""
    return float(np.mean(np.diff(rings) > 0)) if len(rings) > 1 else 1.0
