"""Laser lines of the built-in LiDARs, top first, each with its source."""

from __future__ import annotations

from functools import cache, lru_cache, partial
from importlib import resources

import numpy as np

from slam.data.cloud import Array
from slam.data.sensor import Sensor


@lru_cache(maxsize=1)
def hdl64() -> Sensor:
    """Return Velodyne's HDL-64E, the unit that recorded KITTI."""
    text = resources.files("slam.data").joinpath("hdl64_lasers.csv").read_text(encoding="utf-8")
    _, elevation, offset = np.loadtxt(text.splitlines(), delimiter=",", unpack=True)
    return Sensor("hdl64", np.deg2rad(elevation), offset, source="fitted to KITTI's raw drives 0005 and 0013")


@lru_cache(maxsize=1)
def vlp16() -> Sensor:
    """Return Velodyne's VLP-16."""
    millimetres = [-11.2, -9.7, -8.1, -6.6, -5.1, -3.7, -2.2, -0.7, 0.7, 2.2, 3.7, 5.1, 6.6, 8.1, 9.7, 11.2]
    source = "user manual 63-9243, vertical angles and vertical corrections"
    return Sensor("vlp16", np.deg2rad(np.arange(15.0, -16.0, -2.0)), np.array(millimetres) / 1000, source=source)


@lru_cache(maxsize=1)
def hdl32() -> Sensor:
    """Return Velodyne's HDL-32E: 32 lasers in one column, 4/3 deg apart."""
    return _without_offsets("hdl32", 32 / 3 - 4 / 3 * np.arange(32), np.zeros(32), "user manual 63-9113")


@lru_cache(maxsize=1)
def vlp32c() -> Sensor:
    """Return Velodyne's VLP-32C; its manual counts azimuth offsets clockwise."""
    lines = np.array(
        [
            *[(15, -1.4), (10.333, 1.4), (7, -1.4), (4.667, 1.4), (3.333, -1.4), (2.333, 1.4), (1.667, -4.2)],
            *[(1.333, -1.4), (1, 1.4), (0.667, 4.2), (0.333, -4.2), (0, -1.4), (-0.333, 1.4), (-0.667, 4.2)],
            *[(-1, -4.2), (-1.333, -1.4), (-1.667, 1.4), (-2, 4.2), (-2.333, -4.2), (-2.667, -1.4), (-3, 1.4)],
            *[(-3.333, 4.2), (-3.667, -4.2), (-4, -1.4), (-4.667, 1.4), (-5.333, 4.2), (-6.148, -1.4), (-7.254, 1.4)],
            *[(-8.843, -1.4), (-11.31, 1.4), (-15.639, -1.4), (-25, 1.4)],
        ]
    )
    source = "user manual 63-9325, vertical angles and azimuth offsets"
    return _without_offsets("vlp32c", lines[:, 0], -lines[:, 1], source)


@lru_cache(maxsize=1)
def vls128() -> Sensor:
    """Return Velodyne's VLS-128 (Alpha Prime): 0.11 deg apart near the horizon, eight lasers side by side in a row."""
    above = [15, 11.75, 9.7, 8.43, 7.58, 6.98, 6.48, 6.08, 5.73, 5.43, 5.18, 4.98]
    below = [-6.65, -6.85, -7.15, -7.65, -8.352, -9.244, -10.346, -11.742, -13.565, -16.042, -19.582, -25]
    elevation = np.concatenate([above, 4.83 - 0.11 * np.arange(104), below])
    azimuth = _repeated([-0.911, -2.732, -4.548, -6.354, 6.354, 4.548, 2.732, 0.911], len(elevation))
    source = "nominal angles of Velodyne's driver for ROS, params/VLS128.yaml"
    return _without_offsets("vls128", elevation, azimuth, source)


@cache
def tabled(name: str, nominal: bool = False) -> Sensor:
    """Return a LiDAR of laser_tables.csv, where a comment above each table states its source.

    Args:
        name: Name of the LiDAR.
        nominal: Whether the lines are the design's or one unit's, while each unit has a calibration of its own.
    """
    text = resources.files("slam.data").joinpath("laser_tables.csv").read_text(encoding="utf-8").splitlines()
    elevation, azimuth = np.array([line.split(",")[1:] for line in text if line.startswith(f"{name},")], np.float64).T
    mark = f"# {name}: "
    source = next(line.removeprefix(mark) for line in text if line.startswith(mark))
    return _without_offsets(name, elevation, azimuth, source, nominal)


puck_hires = partial(tabled, "puck-hires")
pandar40p, pandar64 = partial(tabled, "pandar40p", nominal=True), partial(tabled, "pandar64", nominal=True)
xt16, xt32 = partial(tabled, "xt16", nominal=True), partial(tabled, "xt32", nominal=True)
qt64 = partial(tabled, "qt64", nominal=True)
rs16, rs32 = partial(tabled, "rs-16", nominal=True), partial(tabled, "rs-32", nominal=True)
rs_helios, rs_ruby = partial(tabled, "rs-helios", nominal=True), partial(tabled, "rs-ruby", nominal=True)
rs_bpearl = partial(tabled, "rs-bpearl", nominal=True)

#: Field of view above and below the horizon [deg], of current models; the first OS1s of 64 and 16 channels have 16.6.
OUSTER_HALF_VIEW = {"os0": 45.0, "os1": 22.5, "os2": 11.25}
#: Azimuth offsets of an OS1's beams in turn, to the left [deg]; Ouster's client counts them clockwise.
OS1_COLUMNS = [-3.164, -1.055, 1.055, 3.164]


@cache
def ouster(line: str, rings: int) -> Sensor:
    """Return an Ouster: lines evenly over its field of view, nominal, since each unit has a calibration of its own.

    Args:
        line: Product line: os0, os1 or os2.
        rings: Number of rings.
    """
    half = OUSTER_HALF_VIEW[line]
    azimuth = _repeated(OS1_COLUMNS, rings) if line == "os1" else np.zeros(rings)
    source = "field of view of the data sheet, evenly spaced"
    if line == "os1":
        source += "; azimuth offsets of the first generation's design"
    return _without_offsets(f"{line}-{rings}", np.linspace(half, -half, rings), azimuth, source, nominal=True)


os0_16, os0_32, os0_64, os0_128 = (partial(ouster, "os0", rings) for rings in (16, 32, 64, 128))
os1_16, os1_32, os1_64, os1_128 = (partial(ouster, "os1", rings) for rings in (16, 32, 64, 128))
os2_16, os2_32, os2_64, os2_128 = (partial(ouster, "os2", rings) for rings in (16, 32, 64, 128))


def _without_offsets(name: str, elevation_deg: Array, azimuth_deg: Array, source: str, nominal: bool = False) -> Sensor:
    offset, azimuth = np.zeros(len(elevation_deg)), np.deg2rad(azimuth_deg)
    return Sensor(name, np.deg2rad(elevation_deg), offset, azimuth=azimuth, nominal=nominal, source=source)


def _repeated(pattern: list[float], rings: int) -> Array:
    return np.tile(pattern, rings // len(pattern))
