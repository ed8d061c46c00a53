"""The lines of the LiDARs that are built in, top first."""

from __future__ import annotations

from functools import lru_cache
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


def os1_64() -> Sensor:
    """Like an Ouster OS1-64 with 45 deg from top to bottom."""
    return _os1(64)


def os1_128() -> Sensor:
    """Like an Ouster OS1-128."""
    return _os1(128)


@lru_cache(maxsize=2)
def _os1(rings: int) -> Sensor:
    """Evenly from 22.5 to -22.5 deg, its lasers in four columns: nominal, for each Ouster has a calibration of its own.

    The azimuths are the design values of Ouster's first generation, which its client counts clockwise.
    """
    elevation = np.linspace(22.5, -22.5, rings)
    return _without_offsets(f"os1-{rings}", elevation, _repeated([-3.164, -1.055, 1.055, 3.164], rings))


def _without_offsets(name: str, elevation_deg: Array, azimuth_deg: Array) -> Sensor:
    return Sensor(name, np.deg2rad(elevation_deg), np.zeros(len(elevation_deg)), azimuth=np.deg2rad(azimuth_deg))


def _repeated(pattern: list[float], rings: int) -> Array:
    return np.tile(pattern, rings // len(pattern))
