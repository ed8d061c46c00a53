"""Subsets of rings: the input of a LiDAR with fewer lasers, made from the scan of one with more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.data.sensor import Sensor, load_sensor
from slam.data.yaml_files import suggest

#: The HDL-64E's rings next to the nine VLP-16 beams that lie in its field of view.
VLP16_RINGS = (5, 11, 17, 23, 29, 34, 38, 42, 46)
#: Azimuth columns of the HDL-64E: 0.18 degrees each.
POOL_COLUMNS = 2000
POOL = 4  # rings averaged into one
KEPT = 16  # rings of the sparse input by default, whatever the number of rings
PATTERNS = ("every-4th", "vlp16", "average-pool")


def evenly(rings: int, kept: int = KEPT, phase: int = 0) -> Array:
    """Select rings evenly, from the top: for 16 every 4th of 64, every 2nd of 32, every 8th of 128.

    Args:
        rings: Number of rings.
        kept: Number of rings that are kept, at most `rings`.
        phase: Index of the first ring that is kept.

    Returns:
        (kept,) int64 ring indices, increasing.

    Raises:
        InputError: `phase` is not smaller than the step between kept rings.
    """
    step = rings / kept
    if phase not in range(int(step)):
        raise InputError(
            f"phase {phase} of the pattern every-4th; 0 to {int(step) - 1} exist for {kept} of {rings} rings"
        )
    return np.floor(np.arange(kept) * step).astype(np.int64) + phase


def drop_rings(
    cloud: PointCloud,
    pattern: str = "every-4th",
    phase: int = 0,
    sensor: Sensor | None = None,
    rings: int = 64,
    kept: int = KEPT,
) -> PointCloud:
    """Return the cloud that a LiDAR with some of the rings would have seen.

    Args:
        cloud: A cloud with rings.
        pattern: The rings that are kept. 'every-4th': `kept` of them as measured, with their ring indices (`evenly`),
            which is every 4th for 16 of 64. 'vlp16': the nine rings of 64 next to a VLP-16's beams, likewise.
            'average-pool': rings 4g to 4g + 3 of 64 pooled into ring g (`average_pool`).
        phase: Index of the first ring that every-4th keeps.
        sensor: Laser lines for average-pool. Default: HDL-64E.
        rings: Number of rings of the LiDAR.
        kept: Number of rings that every-4th keeps.

    Raises:
        InputError: The pattern or the phase is unknown, the pattern is for 16 of 64 rings only, or the cloud has no
            rings.
    """
    if pattern not in PATTERNS:
        raise InputError(f"unknown ring pattern '{pattern}'{suggest(pattern, PATTERNS)}")
    if pattern != "every-4th" and (rings, kept) != (64, KEPT):
        raise InputError(
            f"the pattern {pattern} selects 16 of 64 rings, not {kept} of {rings}; leave front_end.ring_selection out"
        )
    selected = evenly(rings, kept, phase) if pattern == "every-4th" else VLP16_RINGS
    if cloud.ring is None:
        raise InputError(
            "rings cannot be dropped, for nobody knows which laser the points came from; "
            "name the LiDAR: --sensor hdl64, --sensor vlp16 or --sensor FILE.yaml with its beams"
        )
    if pattern == "average-pool":
        return average_pool(cloud, sensor or load_sensor("hdl64"))
    return cloud.select(np.isin(cloud.ring, selected))


def kept_lines(sensor: Sensor, pattern: str = "every-4th", phase: int = 0, kept: int = KEPT) -> tuple[Sensor, Array]:
    """Return what `drop_rings` leaves of a LiDAR.

    Returns:
        The laser line of every ring index, and the indices that are left (K,), top first.
    """
    if pattern == "average-pool":
        return pooled(sensor), np.arange(-(-sensor.ring_count // POOL))
    return sensor, np.array(VLP16_RINGS) if pattern == "vlp16" else evenly(sensor.ring_count, kept, phase)


def pooled(sensor: Sensor) -> Sensor:
    """Return the mean lines of each POOL neighbouring lasers."""
    starts = np.arange(0, sensor.ring_count, POOL)
    count = np.diff(np.append(starts, sensor.ring_count))
    lines = (sensor.elevation, sensor.offset, sensor.azimuth)
    elevation, offset, azimuth = (np.add.reduceat(values, starts) / count for values in lines)
    return replace(sensor, name=f"{sensor.name}, pooled", elevation=elevation, offset=offset, azimuth=azimuth)


def average_pool(cloud: PointCloud, sensor: Sensor) -> PointCloud:
    """Pool four neighbouring rings and one azimuth column into a point: the input of Yue et al., which no LiDAR gives.

    In each of the 0.18 degree columns (the first begins at azimuth -pi) and for each group of rings 4g..4g+3, the
    ranges of the returns, measured from the laser's own height, are averaged; a group without returns gives no point.
    The point lies at the column's middle azimuth on the mean of the four laser lines. Intensity, time and sigma are
    means; colour is left out.

    Raises:
        InputError: The sensor has fewer rings than the cloud.
    """
    assert cloud.ring is not None
    if len(cloud) and int(cloud.ring.max()) >= sensor.ring_count:
        raise InputError(f"ring {cloud.ring.max()} in a scan, but {sensor.name} has {sensor.ring_count} rings")
    xyz = cloud.xyz.astype(np.float64)
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    column = ((azimuth / (2 * np.pi) + 0.5) * POOL_COLUMNS).astype(np.int64) % POOL_COLUMNS
    cell = (cloud.ring // POOL).astype(np.int64) * POOL_COLUMNS + column
    groups = -(-sensor.ring_count // POOL)
    count = np.bincount(cell, minlength=groups * POOL_COLUMNS)
    kept = np.flatnonzero(count)

    def mean(values: Array) -> Array:
        return np.bincount(cell, values, len(count))[kept] / count[kept]

    reach = mean(np.sqrt(xyz[:, 0] ** 2 + xyz[:, 1] ** 2 + (xyz[:, 2] - sensor.offset[cloud.ring]) ** 2))
    group = kept // POOL_COLUMNS
    lines = pooled(sensor)
    elevation, offset = lines.elevation[group], lines.offset[group]
    azimuth = ((kept % POOL_COLUMNS + 0.5) / POOL_COLUMNS - 0.5) * 2 * np.pi
    rho = reach * np.cos(elevation)
    return PointCloud(
        xyz=np.column_stack([rho * np.cos(azimuth), rho * np.sin(azimuth), reach * np.sin(elevation) + offset]),
        intensity=mean(cloud.intensity),
        ring=group,
        time=None if cloud.time is None else mean(cloud.time),
        sigma=mean(cloud.sigma),
    )
