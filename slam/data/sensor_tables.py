"""The lines of the LiDARs that are built in, top first."""

from __future__ import annotations

from functools import cache, lru_cache, partial
from importlib import resources

import numpy as np

from slam.data.cloud import Array
from slam.data.sensor import Sensor


@lru_cache(maxsize=1)
def hdl64() -> Sensor:
    """Velodyne HDL-64E, the one that KITTI was recorded with: the table says where it is from."""
    text = resources.files("slam.data").joinpath("hdl64_lasers.csv").read_text(encoding="utf-8")
    _, elevation, offset = np.loadtxt(text.splitlines(), delimiter=",", unpack=True)
    return Sensor("hdl64", np.deg2rad(elevation), offset)


@lru_cache(maxsize=1)
def vlp16() -> Sensor:
    """Velodyne VLP-16 user manual 63-9243, table of vertical angles and vertical corrections."""
    millimetres = [-11.2, -9.7, -8.1, -6.6, -5.1, -3.7, -2.2, -0.7, 0.7, 2.2, 3.7, 5.1, 6.6, 8.1, 9.7, 11.2]
    return Sensor("vlp16", np.deg2rad(np.arange(15.0, -16.0, -2.0)), np.array(millimetres) / 1000)


@lru_cache(maxsize=1)
def hdl32() -> Sensor:
    """Velodyne HDL-32E user manual 63-9113: 32 lasers in one column, 4/3 deg apart."""
    return _without_offsets("hdl32", 32 / 3 - 4 / 3 * np.arange(32), np.zeros(32))


@lru_cache(maxsize=1)
def vlp32c() -> Sensor:
    """Velodyne VLP-32C user manual 63-9325, table of vertical angles and azimuth offsets, which it counts clockwise."""
    lines = np.array(
        [
            *[(15, -1.4), (10.333, 1.4), (7, -1.4), (4.667, 1.4), (3.333, -1.4), (2.333, 1.4), (1.667, -4.2)],
            *[(1.333, -1.4), (1, 1.4), (0.667, 4.2), (0.333, -4.2), (0, -1.4), (-0.333, 1.4), (-0.667, 4.2)],
            *[(-1, -4.2), (-1.333, -1.4), (-1.667, 1.4), (-2, 4.2), (-2.333, -4.2), (-2.667, -1.4), (-3, 1.4)],
            *[(-3.333, 4.2), (-3.667, -4.2), (-4, -1.4), (-4.667, 1.4), (-5.333, 4.2), (-6.148, -1.4), (-7.254, 1.4)],
            *[(-8.843, -1.4), (-11.31, 1.4), (-15.639, -1.4), (-25, 1.4)],
        ]
    )
    return _without_offsets("vlp32c", lines[:, 0], -lines[:, 1])


@lru_cache(maxsize=1)
def vls128() -> Sensor:
    """Velodyne VLS-128 (Alpha Prime), nominal angles as Velodyne's driver for ROS has them (params/VLS128.yaml).

    0.11 deg apart near the horizon; eight lasers side by side in each row of its array.
    """
    above = [15, 11.75, 9.7, 8.43, 7.58, 6.98, 6.48, 6.08, 5.73, 5.43, 5.18, 4.98]
    below = [-6.65, -6.85, -7.15, -7.65, -8.352, -9.244, -10.346, -11.742, -13.565, -16.042, -19.582, -25]
    elevation = np.concatenate([above, 4.83 - 0.11 * np.arange(104), below])
    azimuth = _repeated([-0.911, -2.732, -4.548, -6.354, 6.354, 4.548, 2.732, 0.911], len(elevation))
    return _without_offsets("vls128", elevation, azimuth)


@cache
def tabled(name: str, nominal: bool = False) -> Sensor:
    """A sensor of laser_tables.csv, which says beside each table where it is from.

    Those that are nominal are of one unit, or of the design, where each unit has a calibration of its own.
    """
    text = resources.files("slam.data").joinpath("laser_tables.csv").read_text(encoding="utf-8")
    rows = [line.split(",")[1:] for line in text.splitlines() if line.startswith(f"{name},")]
    elevation, azimuth = np.array(rows, np.float64).T
    return _without_offsets(name, elevation, azimuth, nominal)


puck_hires = partial(tabled, "puck-hires")
pandar40p, pandar64 = partial(tabled, "pandar40p", nominal=True), partial(tabled, "pandar64", nominal=True)
xt16, xt32 = partial(tabled, "xt16", nominal=True), partial(tabled, "xt32", nominal=True)
qt64 = partial(tabled, "qt64", nominal=True)
rs16, rs32 = partial(tabled, "rs-16", nominal=True), partial(tabled, "rs-32", nominal=True)
rs_helios, rs_ruby = partial(tabled, "rs-helios", nominal=True), partial(tabled, "rs-ruby", nominal=True)
rs_bpearl = partial(tabled, "rs-bpearl", nominal=True)

#: Degrees above and below the horizon, of the lines as they are sold (OS1: its data sheet, 128 channels; the first
#: OS1s of 64 and 16 channels see 16.6).
OUSTER_HALF_VIEW = {"os0": 45.0, "os1": 22.5, "os2": 11.25}
#: Of an OS1's beams in turn, to the left [deg]: design values of its first generation, clockwise in Ouster's client.
OS1_COLUMNS = [-3.164, -1.055, 1.055, 3.164]


@cache
def ouster(line: str, rings: int) -> Sensor:
    """An Ouster of the lines os0, os1 and os2: evenly over its field of view, and so nominal, for each has a
    calibration of its own, which its metadata (.json) have."""
    half = OUSTER_HALF_VIEW[line]
    azimuth = _repeated(OS1_COLUMNS, rings) if line == "os1" else np.zeros(rings)
    return _without_offsets(f"{line}-{rings}", np.linspace(half, -half, rings), azimuth, nominal=True)


os0_16, os0_32, os0_64, os0_128 = (partial(ouster, "os0", rings) for rings in (16, 32, 64, 128))
os1_16, os1_32, os1_64, os1_128 = (partial(ouster, "os1", rings) for rings in (16, 32, 64, 128))
os2_16, os2_32, os2_64, os2_128 = (partial(ouster, "os2", rings) for rings in (16, 32, 64, 128))


def _without_offsets(name: str, elevation_deg: Array, azimuth_deg: Array, nominal: bool = False) -> Sensor:
    offset, azimuth = np.zeros(len(elevation_deg)), np.deg2rad(azimuth_deg)
    return Sensor(name, np.deg2rad(elevation_deg), offset, azimuth=azimuth, nominal=nominal)


def _repeated(pattern: list[float], rings: int) -> Array:
    return np.tile(pattern, rings // len(pattern))
