"""Rings of scans: the meaning of the numbers in files, and laser lines where there are none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data.beams import line_misfit, nearest_rings, recover_rings
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.point_files import Points
from slam.data.problem import Problem
from slam.data.sensor import Sensor

MOST_RINGS = 1024  # of an unknown sensor
COUNTS = (16, 32, 40, 64, 128)  # usual numbers of rings
MANY = 0.05  # share of a scan's points; if more have no ring, the rings of the others are not believed either
IN_ORDER = 0.9  # share of all pairs of numbers that are in the order of their heights; of two halves in turn it is 0.75
STRAY = 1e-4  # share of the points; a ring number of fewer is no ring
PROBES = 200  # points of a laser that are compared with the laser lines
#: Share of the points off the laser lines above which the lines are another LiDAR's, and how far off, as a share of the
#: lines' spacing: for rings from the file, and for the rings of the nearest lines, where half is off without relation.
RING_MISFIT, NEAREST_MISFIT = (0.2, 0.5), (0.05, 0.25)
FEWEST = 1000  # points for a judgement on the lines


def usual_rings(highest: int) -> int:
    """Return the number of rings of a LiDAR whose highest ring number, from 0, is known.

    It is the next usual number, since the uppermost rings often see only sky.
    """
    return next((count for count in COUNTS if count > highest), 1 << highest.bit_length())


def rings_by_lines(xyz: Array, sensor: Sensor) -> Array:
    """Return the rings (N,) int16 of points (N, 3) without ring numbers.

    Scans stored ring by ring, as KITTI's, are recovered exactly, also after motion compensation, which moves points off
    their lines. In others each point takes the nearest laser line.
    """
    return _rings_and_order(xyz, sensor)[0]


def _rings_and_order(xyz: Array, sensor: Sensor) -> tuple[Array, bool]:
    """Rings (N,) as in `rings_by_lines`, and whether the scan is stored ring by ring."""
    ring, found = recover_rings(xyz)
    in_order = found == sensor.ring_count
    return (ring if in_order else nearest_rings(xyz, sensor)), in_order


def rings_of_numbers(numbers: Array, ring_of: Array) -> Array:
    """Return the ring (N,) int of each ring number (N,), by the ring (K,) of each possible number; -1 for none."""
    whole = _whole(numbers, len(ring_of))
    return np.where(whole < 0, -1, ring_of[whole])


def ring_numbers(
    scans: Sequence[Points], sensor: Sensor | None, where: object
) -> tuple[Array | None, tuple[Problem, ...]]:
    """Find the ring of each ring number in the files.

    Args:
        scans: The first scans.
        sensor: The LiDAR, None if unknown.
        where: Name in messages.

    Returns:
        (K,) the ring, 0 on top, of each number from 0, or None if there are no ring numbers; and the problems.

    Raises:
        InputError: The numbers are not those of the sensor.
    """
    found = [(points.xyz, _whole(points.ring, MOST_RINGS)) for points in scans if points.ring is not None]
    if not found:
        return None, ()
    lowest, highest = _lowest_and_highest([ring for _, ring in found])
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


def wrong_lines(scans: Sequence[Points], ring_of: Array | None, sensor: Sensor, where: object) -> tuple[Problem, ...]:
    """Check that the points lie on the laser lines of the sensor; the scans must not be motion-compensated.

    Args:
        scans: The first scans.
        ring_of: (K,) the ring of each ring number in the files, None without numbers.
        sensor: The LiDAR.
        where: Name in messages.

    Returns:
        A Problem if they do not.
    """
    if sensor.ring_count < 2:
        return ()
    (most, far), misfits = NEAREST_MISFIT, [np.zeros(0)]
    for points in scans:
        if ring_of is not None and points.ring is not None:
            ring, known = rings_of_numbers(points.ring, ring_of), True
        else:
            ring, known = _rings_and_order(points.xyz, sensor)
        if known:
            most, far = RING_MISFIT
        misfits.append(line_misfit(points.xyz[ring >= 0], ring[ring >= 0], sensor))
    misfit = np.concatenate(misfits)
    off = float(np.mean(misfit > far)) if len(misfit) >= FEWEST else 0.0
    if off <= most:
        return ()
    text = (
        f"{where}: {off:.0%} of the points lie farther from the laser lines of {sensor.name} than {far:g} of the "
        "distance between lines; name the right LiDAR with --sensor, or estimate its lines with lidarlift fit-lasers"
    )
    return (Problem("laser lines", text),)


def _whole(ring: Array, count: int) -> Array:
    """(N,) int64: the numbers of rings, -1 for any that is none of 0 .. count - 1."""
    with np.errstate(invalid="ignore"):
        sound = np.isfinite(ring) & (ring >= 0) & (ring < count) & (ring == np.floor(ring))
    return np.where(sound, np.where(sound, ring, 0).astype(np.int64), -1)


def _lowest_and_highest(scans: Sequence[Array]) -> tuple[int, int]:
    """The lowest and the highest ring number, without strays and single scans; -1: points without one."""
    seen = np.zeros(MOST_RINGS + 1, np.int64)
    for numbers in scans:
        count = np.bincount(numbers + 1, minlength=len(seen))
        seen += count > STRAY * len(numbers)
    usual = np.flatnonzero(seen >= min(len(scans), 2)) - 1
    return (int(usual[0]), int(usual[-1])) if len(usual) else (-1, -1)


def _from_top(xyz: Array, numbers: Array, count: int, sensor: Sensor | None) -> Array:
    """(count,) the ring of each number 0 .. count - 1.

    Velodyne's drivers count from the bottom, others from the top; numbers of lasers in firing order go up and down.
    """
    slope = xyz[:, 2] / np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 1e-3)
    present = np.unique(numbers)
    heights = np.array([np.median(slope[numbers == number]) for number in present])
    down, up = np.arange(count), np.arange(count)[::-1]
    rises = float(np.mean((present - present.mean()) * (heights - heights.mean()))) > 0
    first, second = np.triu_indices(len(present), 1)
    if len(present) < 4 or np.mean((heights[second] > heights[first]) == rises) > IN_ORDER:
        return up if rises else down
    if sensor is None:
        order = present[np.argsort(-heights, kind="stable")]
        return np.concatenate([order, np.setdiff1d(down, order)]).argsort()
    ring_of = np.full(count, -1)
    ring_of[present] = _rings_of_lasers([xyz[numbers == number] for number in present], sensor)
    ring_of[ring_of < 0] = np.setdiff1d(down, ring_of)
    return ring_of


def _rings_of_lasers(lasers: Sequence[Array], sensor: Sensor) -> Array:
    """(K,) a ring for each of K lasers, by their points (N, 3): together they are nearest to the laser lines."""
    from scipy.optimize import linear_sum_assignment  # slow to import, and seldom needed

    tangent = np.tan(sensor.elevation)[:, None]
    cost = []
    for xyz in lasers:
        some = xyz[:: max(len(xyz) // PROBES, 1)].astype(np.float64)
        rho = np.maximum(np.hypot(some[:, 0], some[:, 1]), 1e-3)
        off = np.abs(some[:, 2] - tangent * rho - sensor.offset[:, None]) / rho
        cost.append(np.median(off, axis=1))
    return np.asarray(linear_sum_assignment(np.array(cost))[1])
