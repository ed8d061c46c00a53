"""Measurements of an ordinary IMU and GNSS receiver along a drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from slam.data.cloud import Array

GRAVITY = 9.81  # m/s^2
IMU_RATE, FIX_RATE = 200.0, 1.0  # Hz
#: Of MEMS IMUs for cars and drones (data sheets of the BMI088 and ICM-20948): noise densities in rad/s and m/s^2 a root
#: Hz, constant biases, and how far these walk in a root of a second.
GYRO_NOISE, GYRO_BIAS, GYRO_WALK = np.deg2rad(0.014), np.deg2rad(0.3), np.deg2rad(0.003)
FORCE_NOISE, FORCE_BIAS, FORCE_WALK = 1.7e-3, 0.08, 3e-4
#: Of a receiver without corrections, east, north and up [m].
FIX_SIGMA = (1.2, 1.2, 2.5)
#: Where the world's origin is: latitude and longitude [deg], altitude [m]; Karlsruhe, where KITTI was recorded.
ORIGIN = (49.011, 8.4228, 116.0)
EARTH = 6378137.0  # m


@dataclass(frozen=True, eq=False)
class Motion:
    """An IMU's measurements.

    stamps  (N,) seconds
    rate    (N, 3) rad/s, of turning, in its own axes
    force   (N, 3) m/s^2: its acceleration less gravity's, in its own axes; upwards at a stand
    """

    stamps: Array
    rate: Array
    force: Array


@dataclass(frozen=True, eq=False)
class Fixes:
    """A GNSS receiver's.

    stamps  (N,) seconds
    places  (N, 3) latitude, longitude [deg], altitude [m]
    sigma   east, north, up [m]
    """

    stamps: Array
    places: Array
    sigma: tuple[float, float, float] = FIX_SIGMA


def motion_along(stamps: Array, poses: Array, rng: np.random.Generator, rate: float = IMU_RATE) -> Motion:
    """Simulate an IMU whose poses (M, 4, 4) T_world_imu at `stamps` (M,) [s] are known, smoothly between them."""
    at = np.arange(stamps[0], stamps[-1], 1 / rate)
    turning = RotationSpline(stamps, Rotation.from_matrix(poses[:, :3, :3]))
    acceleration = CubicSpline(stamps, poses[:, :3, 3])(at, 2)
    force = turning(at).inv().apply(acceleration + np.array([0, 0, GRAVITY]))
    gyro = _drifting(len(at), rate, GYRO_NOISE, GYRO_BIAS, GYRO_WALK, rng)
    return Motion(at, turning(at, 1) + gyro, force + _drifting(len(at), rate, FORCE_NOISE, FORCE_BIAS, FORCE_WALK, rng))


def _drifting(count: int, rate: float, noise: float, bias: float, walk: float, rng: np.random.Generator) -> Array:
    """(count, 3): white noise on a bias that walks."""
    white, steps = rng.standard_normal((2, count, 3))
    return noise * np.sqrt(rate / 2) * white + bias * rng.standard_normal(3) + walk * rate**-0.5 * np.cumsum(steps, 0)


def fixes_along(stamps: Array, poses: Array, rng: np.random.Generator, rate: float = FIX_RATE) -> Fixes:
    """Simulate a receiver at poses (M, 4, 4) at `stamps` (M,) [s]; the world's x points east."""
    at = np.arange(stamps[0], stamps[-1], 1 / rate)
    place = CubicSpline(stamps, poses[:, :3, 3])(at) + FIX_SIGMA * rng.standard_normal((len(at), 3))
    latitude = ORIGIN[0] + np.rad2deg(place[:, 1] / EARTH)
    longitude = ORIGIN[1] + np.rad2deg(place[:, 0] / EARTH) / np.cos(np.deg2rad(ORIGIN[0]))
    return Fixes(at, np.column_stack([latitude, longitude, ORIGIN[2] + place[:, 2]]))
