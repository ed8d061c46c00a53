"""Trajectory of a hand-held LiDAR on a walk through the building.

The route is a polyline with smoothed corners; a speed profile gives the times, and the motion of steps, arm and hand is
added. The trajectory is smooth: splines with two derivatives, and sines.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.simulation.drives import RATE, Drive
from slam.simulation.indoors.plan import EAST, FOOT, HEAD, RISE, RISERS, STOREY, TREAD, WEST, Stairs

HAND = 1.3  # metres above the floor
PACE, CLIMB = 1.2, 0.75  # m/s on the level, and along the plan on stairs
TURN, HURRY = 1.4, 0.9  # rad/s in corners, m/s^2 when the speed changes
SPIN = 2.0  # rad/s on the spot
SAMPLE, TICK = 0.02, 0.02  # m, s
CORNER, EDGE = 0.5, 0.2  # m: how widely corners are cut, and how softly stairs begin
START, MOMENT, HEAD_TURN = 0.12, 0.15, 0.25  # m/s: slowest; s: over which speed and heading are smoothed
REST = 1.0  # s that the path is known before the first frame and after the last
STEPS = 1.8  # a second at full pace
#: At full pace, bob and surge [m] and nod [rad] with every step; sway [m], roll and wobble [rad] with every other.
BOB, SURGE, SWAY = 0.02, 0.012, 0.025
NOD, ROLL, WOBBLE = np.deg2rad([1.2, 1.8, 1.6])
#: How the hold changes slowly: roll, pitch, yaw [rad], left and up [m] are sums of three sines each.
DRIFT = np.array([np.deg2rad(2.5), np.deg2rad(3.0), np.deg2rad(3.5), 0.02, 0.03])
_PERIODS = np.array([[17.3, 7.9, 3.1], [13.9, 6.7, 2.7], [19.1, 8.3, 3.7], [15.7, 5.9, 2.3], [11.3, 7.1, 2.9]])  # s
_SHARES = np.array([0.6, 0.3, 0.1])


class Stop(NamedTuple):
    """A corner of the route: x, y and the height of the floor [m]; how long [s] and how many turns one stands there."""

    x: float
    y: float
    z: float
    pause: float = 0.0
    turns: int = 0


def _up(stairs: Stairs) -> list[Stop]:
    landing, middle = RISERS * RISE, HEAD + 0.75
    return [
        Stop(stairs.up, FOOT - TREAD / 2, 0.0),
        Stop(stairs.up, HEAD, landing),
        Stop(stairs.up, middle, landing),
        Stop(stairs.on, middle, landing),
        Stop(stairs.on, HEAD + TREAD / 2, landing),
        Stop(stairs.on, FOOT, STOREY),
    ]


AISLE = 1.15  # y of the way along the corridors
#: Out of an office, along the corridor, up the eastern stairs, through two rooms, down the western stairs and back.
ROUTE = (
    Stop(3.3, -3.4, 0.0, pause=1.0),
    Stop(WEST.up, -2.6, 0.0),
    Stop(WEST.up, AISLE, 0.0),
    Stop(15.0, AISLE, 0.0, pause=0.6),
    Stop(EAST.up, AISLE, 0.0),
    *_up(EAST),
    Stop(EAST.on, AISLE, STOREY),
    Stop(20.9, AISLE, STOREY),
    Stop(20.9, -3.0, STOREY),
    Stop(15.4, -3.0, STOREY, pause=4.0, turns=1),
    Stop(13.2, -3.0, STOREY),
    Stop(13.2, AISLE, STOREY),
    Stop(WEST.on, AISLE, STOREY),
    *_up(WEST)[::-1],
    Stop(WEST.up, -2.6, 0.0),
    Stop(3.3, -3.4, 0.0, pause=1.0),
)


class Walk:
    """T_world_sensor at any time from REST before the start to REST after `end` [s]; constant beyond."""

    def __init__(self, route: tuple[Stop, ...] = ROUTE) -> None:
        line, corners = _line(np.array([stop[:3] for stop in route]))
        stays = [(int(corner), stop) for corner, stop in zip(corners, route, strict=True) if stop.pause]
        time, at, spins = _timed(line, stays)
        self.end = float(time[-1])
        ticks = np.arange(-REST, self.end + REST, TICK)
        way = gaussian_filter1d(np.interp(ticks, time, at), MOMENT / TICK, mode="nearest")
        samples = np.arange(len(line))
        heading = np.unwrap(np.arctan2(np.gradient(line[:, 1]), np.gradient(line[:, 0])))
        turned = sum(np.clip((ticks - start) * SPIN, 0.0, 2 * np.pi * turns) for start, turns in spins)
        yaw = gaussian_filter1d(np.interp(way, samples, heading) + turned, HEAD_TURN / TICK, mode="nearest")
        pace = np.gradient(way, TICK) * SAMPLE / PACE
        phase = 2 * np.pi * STEPS * TICK * np.cumsum(np.sqrt(np.maximum(pace, 0)))
        places = [np.interp(way, samples, column) for column in line.T]
        self._ticks = ticks
        self._channels = CubicSpline(ticks, np.column_stack([*places, yaw, phase, pace]))

    def floor(self, stamps: Array) -> Array:
        """Return the height (K,) [m] of the floor, sloping on stairs."""
        return np.asarray(self._at(stamps)[:, 2])

    def yaw(self, stamps: Array) -> Array:
        """Return the heading (K,) [rad] of the sensor's x axis, not wrapped."""
        channels = self._at(stamps)
        return np.asarray(channels[:, 3] + channels[:, 5] * WOBBLE * np.sin(channels[:, 4] / 2) + _drift(stamps)[2])

    def __call__(self, stamps: Array) -> Array:
        """(K, 4, 4) T_world_sensor at stamps (K,) [s]."""
        x, y, floor, course, phase, strength = self._at(stamps).T
        roll, pitch, _, aside, lift = _drift(stamps)
        along = strength * SURGE * np.sin(phase + 0.7)
        left = strength * SWAY * np.sin(phase / 2 + 0.4) + aside
        poses = np.tile(np.eye(4), (len(x), 1, 1))
        poses[:, 0, 3] = x + along * np.cos(course) - left * np.sin(course)
        poses[:, 1, 3] = y + along * np.sin(course) + left * np.cos(course)
        poses[:, 2, 3] = floor + HAND + strength * BOB * np.cos(phase) + lift
        roll = roll + strength * ROLL * np.sin(phase / 2 + 1.1)
        pitch = pitch + strength * NOD * np.sin(phase + 0.3)
        poses[:, :3, :3] = _turned(self.yaw(stamps), pitch, roll)
        return poses

    def _at(self, stamps: Array) -> Array:
        """(K, 6): x, y and height of the floor [m], course and phase of the steps [rad], share of the full pace."""
        return np.asarray(self._channels(np.clip(stamps, self._ticks[0], self._ticks[-1])))


@lru_cache(maxsize=1)
def _walk() -> Walk:
    return Walk()


def building(spacing: float | None = None) -> Drive:
    """Walk for a minute and a half through two floors with a hand-held LiDAR, at ten frames per second."""
    if spacing is not None:
        raise InputError("building: --spacing does not apply to a walk, since steps and turns take time; leave it out")
    walk = _walk()
    stamps = np.arange(0.0, walk.end, 1 / RATE)
    position = walk(stamps)[:, :3, 3]
    position[:, 2] = walk.floor(stamps)
    return Drive("building", stamps, position, walk.yaw(stamps), scene="building", path=walk, height=HAND)


def _line(corners: Array) -> tuple[Array, Array]:
    """The route (N, 3) every SAMPLE along the plan, its corners (C, 3) cut; and the sample (C,) nearest to each."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners[:, :2], axis=0), axis=1))])
    at = np.arange(0.0, way[-1], SAMPLE)
    dense = np.column_stack([np.interp(at, way, column) for column in corners.T])
    widths = np.array([CORNER, CORNER, EDGE]) / SAMPLE
    cut = np.column_stack(
        [gaussian_filter1d(column, w, mode="nearest") for column, w in zip(dense.T, widths, strict=True)]
    )
    shorter = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(cut[:, :2], axis=0), axis=1))])
    even = np.arange(0.0, shorter[-1], SAMPLE)
    line = np.column_stack([np.interp(even, shorter, column) for column in cut.T])
    return line, np.searchsorted(even, np.interp(way, at, shorter)).clip(max=len(even) - 1)


def _timed(line: Array, stays: list[tuple[int, Stop]]) -> tuple[Array, Array, list[tuple[float, int]]]:
    """Times [s] from 0, the samples of the line (N, 3) that are reached then, and when how many turns begin."""
    at = [index for index, _ in stays]
    wait = np.zeros(len(line))
    wait[at] = [stop.pause for _, stop in stays]
    speed = _speed(line, at)
    leave = np.cumsum(wait) + np.concatenate([[0.0], np.cumsum(2 * SAMPLE / (speed[1:] + speed[:-1]))])
    spins = []
    for index, stop in stays:
        spins.append((float(leave[index] - stop.pause / 2 - np.pi * stop.turns / SPIN), stop.turns))
    return np.column_stack([leave - wait, leave]).ravel(), np.repeat(np.arange(len(line)), 2), spins


def _speed(line: Array, stops: list[int]) -> Array:
    """(N,) m/s at the samples of the line, slow in corners, on stairs and around stops."""
    heading = np.unwrap(np.arctan2(np.gradient(line[:, 1]), np.gradient(line[:, 0])))
    level = np.abs(np.gradient(line[:, 2])) < 0.2 * SAMPLE
    bend = np.abs(np.gradient(heading)) / SAMPLE
    speed = np.minimum(np.where(level, PACE, CLIMB), TURN / np.maximum(bend, 1e-6))
    speed[stops] = START
    for limited in (speed, speed[::-1]):
        for index in range(1, len(limited)):
            limited[index] = min(limited[index], np.sqrt(limited[index - 1] ** 2 + 2 * HURRY * SAMPLE))
    return speed


def _drift(stamps: Array) -> Array:
    """(5, K): of the hold, in DRIFT's order."""
    waves = np.sin(2 * np.pi * np.asarray(stamps)[:, None, None] / _PERIODS + np.arange(15).reshape(5, 3))
    return np.asarray(DRIFT[:, None] * (waves @ _SHARES).T)


def _turned(yaw: Array, pitch: Array, roll: Array) -> Array:
    """(K, 3, 3): about z, then y, then x, each of the axes that the turn before has left."""
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
