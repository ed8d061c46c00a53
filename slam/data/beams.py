"""Rings of points without ring numbers, their distance from laser lines, and times by azimuth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data import kernels
from slam.data.cloud import Array
from slam.data.conventions import INSTANTS
from slam.data.problem import Problem, spans
from slam.data.sensor import Sensor

#: What a change of ring without a wraparound costs, in badly fitting points: an eighth of a full ring.
SWITCH_COST = 250.0
#: Above this mean misfit to the laser lines (0..1; unrelated points give about 0.5) the points are another sensor's.
MISFIT_LIMIT = 0.35


def recover_rings(xyz: Array) -> tuple[Array, int]:
    """Recover the rings of a scan stored ring by ring, from azimuth wraparounds: rings (N,) int16, and their number.

    KITTI's velodyne files are in this order: top ring first, each counter-clockwise from +x (forward). A new ring
    starts where the azimuth mod 2 pi falls by more than pi.
    """
    if len(xyz) == 0:
        return np.zeros(0, np.int16), 0
    ring = kernels.count_up(kernels.wraps(xyz))
    return ring, int(ring[-1]) + 1


def rings_in_file_order(xyz: Array, sensor: Sensor, path: Path) -> tuple[Array | None, tuple[Problem, ...]]:
    """Recover the rings of a scan stored ring by ring, top first, of a known sensor with R rings.

    If the wraparounds do not give R rings, each point is assigned to a laser line: rings never decrease along the file,
    and change at wraparounds, or elsewhere if many points require it (two rings without a wraparound between them).

    Args:
        xyz: (N, 3) points [m].
        sensor: The LiDAR.
        path: Name of the scan in messages.

    Returns:
        Rings (N,) int16, None if the points do not lie on the sensor's lines at all; and problems of the scan.
    """
    ring, found = recover_rings(xyz)
    if found == sensor.ring_count or found == 0:
        return ring, ()
    tangent = np.tan(sensor.elevation)
    spacing = np.abs(np.gradient(tangent)) if sensor.ring_count > 1 else np.ones(1)
    weight = _ahead(xyz) if sensor.motion_compensated else np.ones(len(xyz), np.float32)
    wraps = kernels.wraps(xyz)
    ring, misfit = kernels.cheapest_lines(xyz, weight, wraps, tangent, sensor.offset, spacing, SWITCH_COST)
    count = f"{path}: {found} rings where the sensor {sensor.name} has {sensor.ring_count}"
    if misfit > MISFIT_LIMIT:
        remedy = "rings left out; name the right sensor"
        return None, (Problem("ring count", f"{count}, and the points do not lie on its laser lines: {remedy}"),)
    present = np.bincount(ring, minlength=sensor.ring_count) > 0
    missing = "" if present.all() else f"; no points of ring {spans(_runs(np.flatnonzero(~present)))}"
    return ring, (Problem("ring count", f"{count}: taken from the laser lines instead{missing}"),)


def _ahead(xyz: Array) -> Array:
    """Weights (N,) that select about 20 degrees ahead, seen at mid-sweep.

    There motion compensation moved no point off its laser's line; behind, it moves points by half a sweep's motion.
    """
    cosine = xyz[:, 0] / np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), np.float32(1e-3))
    return np.clip(cosine, 0, 1) ** 16


def nearest_rings(xyz: Array, sensor: Sensor) -> Array:
    """Return the ring (N,) int16 whose laser line passes nearest to each point, for scans in any order."""
    return np.asarray(kernels.nearest_lines(xyz, np.tan(sensor.elevation), sensor.offset))


def line_misfit(xyz: Array, ring: Array, sensor: Sensor) -> Array:
    """Measure how far points lie off the laser lines of their rings.

    Args:
        xyz: (N, 3) points [m].
        ring: (N,) their rings.
        sensor: The LiDAR, with more than one ring.

    Returns:
        (N,) float64 angle between each point and its line, as a share of the spacing of the lines there. Without any
        relation to the lines it is spread evenly over 0 to 0.5 if every point takes the nearest line.
    """
    spacing = np.abs(np.gradient(sensor.elevation))[ring]
    elevation = np.arctan2(xyz[:, 2] - sensor.offset[ring], np.hypot(xyz[:, 0], xyz[:, 1]))
    return np.asarray(np.abs(elevation - sensor.elevation[ring]) / spacing)


def turn_times(xyz: Array, sweep: float, stamp: str = "middle") -> Array:
    """Return the time of each point, (N,) float32 [s] from the scan's stamp, for KITTI's raw scans.

    The sensor turns once per sweep from the rear over the left and the front to the right.

    Args:
        xyz: (N, 3) points.
        sweep: Duration of a sweep [s].
        stamp: Instant of the sweep that the stamp refers to: the middle in KITTI, when the sensor looks ahead; 'start'
            or 'end' if a converter into KITTI's layout kept another stamp.
    """
    return np.asarray(kernels.turn_times(xyz, sweep, INSTANTS[stamp]))


def _runs(numbers: Array) -> list[tuple[int, int]]:
    """Unbroken runs of increasing whole numbers (N,), N > 0."""
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts]
