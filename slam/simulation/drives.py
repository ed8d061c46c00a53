"""Trajectories of the car: the built-in drives, and drives along the poses of a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import read_poses
from slam.simulation.drive_names import DRIVES

RATE = 10.0  # frames a second, KITTI's
LANE = 1.75  # metres from the middle of the road to the middle of a lane; traffic keeps to the right
SAMPLE_SPACING = 0.25  # metres between the samples of a built-in path
TOP_SPEED, SIDEWAYS, ALONG = 11.0, 2.5, 1.5  # m/s, and m/s^2 in curves and when the speed changes
SMOOTHED = 32  # samples at either end of a path that its smoothing bends
JUMP = 10.0  # metres between two poses that no car drives in a frame


@dataclass(frozen=True, eq=False)
class Drive:
    """N frames of a car in the plane; the height of the ground comes from the terrain.

    Attributes:
        name: Name of the drive.
        stamps: (N,) [s].
        position: (N, 3) [m]: x, y, and the height of the road.
        yaw: (N,) [rad], not wrapped.
        tunnel: Travelled distances [m] at the ends of a tunnel, or None.
        jam: Whether the car is in a traffic jam.
        scene: Name of the scene, one of SCENES.
        period: Distance [m] after which the static scene repeats, everywhere; None: nothing repeats.
        path: T_world_sensor (K, 4, 4) at stamps (K,), if it is known between frames too (a hand-held sensor); None:
            constant velocity between frames.
        height: Default height of the LiDAR above the ground [m]; None: that of the car.
        rate: Rotation rate of the LiDAR [Hz], which is the frame rate unless frames are `thinned` or set by `spacing`.
    """

    name: str
    stamps: Array
    position: Array
    yaw: Array
    tunnel: tuple[float, float] | None = None
    jam: bool = False
    scene: str = "town"
    period: float | None = None
    path: Callable[[Array], Array] | None = None
    height: float | None = None
    rate: float = RATE

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def way(self) -> Array:
        """Travelled distance (N,) since the first frame [m]."""
        steps = np.linalg.norm(np.diff(self.position[:, :2], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def unobservable(self, reach: float) -> tuple[float, float] | None:
        """Return the travelled distances [m] between which the position along the road is unobservable, or None.

        There both ends of the tunnel are farther than `reach` [m], and its walls look the same everywhere. A scene that
        repeats with a `period` longer than a frame's step makes steps observable, but only modulo the period.
        """
        if self.tunnel is None or self.tunnel[1] - self.tunnel[0] <= 2 * reach:
            return None
        return self.tunnel[0] + reach, self.tunnel[1] - reach


def built_in(name: str, spacing: float | None = None) -> Drive:
    """Create one of DRIVES; `spacing` is the distance between frames [m], None for ten frames per second.

    Raises:
        InputError: The name is unknown.
    """
    return DRIVES.load(name)(spacing)


def loop(spacing: float | None = None) -> Drive:
    """Drive around a block, along the first street again, across, and along a street in the reverse direction."""
    corners = [(0, 0), (110, 0), (110, 58), (-12, 58), (-12, 0), (52, 0), (52, 58), (100, 58)]
    return _driven("loop", _lane(np.array(corners, float)), spacing)


def straight(spacing: float | None = None) -> Drive:
    """Drive 300 m along a street."""
    return _driven("straight", _lane(np.array([(0.0, 0.0), (300.0, 0.0)])), spacing)


def tunnel(spacing: float | None = None) -> Drive:
    """Drive along a street, through 200 m of a smooth tunnel that looks the same everywhere, and along a street."""
    return _driven("tunnel", _lane(np.array([(0.0, 0.0), (320.0, 0.0)])), spacing, tunnel=(60.0, 260.0))


def jam(spacing: float | None = None) -> Drive:
    """Drive half a minute in stop-and-go traffic, 50 m."""
    stamps = np.arange(350) / RATE
    speed = np.clip(1.6 + 2.2 * np.sin(0.45 * stamps) + 0.7 * np.sin(1.07 * stamps + 1.0), 0.0, None)
    path = _lane(np.array([(0.0, 0.0), (120.0, 0.0)]))
    return _along("jam", path, stamps, _way(speed), spacing, jam=True)


def crawl(spacing: float | None = None) -> Drive:
    """Drive half a minute in crawling traffic, 20 m: 0.02 to 0.2 m per frame, and three stops."""
    stamps = np.arange(320) / RATE
    speed = np.clip(0.55 + 1.25 * np.sin(0.55 * stamps + 0.4) + 0.1 * np.sin(1.3 * stamps), 0.0, 1.95)
    path = _lane(np.array([(0.0, 0.0), (120.0, 0.0)]))
    return _along("crawl", path, stamps, _way(speed), spacing, jam=True)


def motorway(spacing: float | None = None) -> Drive:
    """Drive 480 m in the left of two lanes at 30 m/s from the first frame on: gentle curves, 8 m up and down."""
    way = 3.0 * np.arange(161)
    metre = np.arange(0.0, way[-1] + 1.0, SAMPLE_SPACING)
    path = _bending(np.sin(metre / 85.0) / 1100.0)
    drive = _along("motorway", path, np.arange(len(way)) / RATE, way, None, scene="motorway")
    drive.position[:, 2] = 4.0 * (1 - np.cos(2 * np.pi * way / 460.0))
    return _spaced(drive, spacing)


def bridge(spacing: float | None = None) -> Drive:
    """Drive 300 m along a straight bridge at 10 to 15 m/s, with nothing else within the range of a LiDAR.

    The static scene repeats every 36 m, the length of a span with two lamps. The posts of the railings repeat every
    2 m: where no lamps are seen, the step of a frame, 1.0 to 1.5 m, is ambiguous by 2 m.
    """
    stamps = np.arange(240) / RATE
    speed = 12.5 + 2.3 * np.sin(0.5 * stamps)
    path = _bending(np.zeros(1600))
    return _along("bridge", path, stamps, _way(speed), spacing, scene="bridge", period=36.0)


def lorries(spacing: float | None = None) -> Drive:
    """Drive 135 m along a street at 8 m/s, between houses, past parked lorries whose sides are 3.7 m from the car."""
    stamps = np.arange(170) / RATE
    return _along(
        "lorries", _bending(np.zeros(800)), stamps, _way(8.0 + 0.4 * np.sin(stamps)), spacing, scene="lorries"
    )


def traffic(spacing: float | None = None) -> Drive:
    """Drive 280 m along an avenue at 8 to 14 m/s in dense traffic: a third of the echoes is from moving vehicles."""
    stamps = np.arange(250) / RATE
    speed = 11.0 + 2.5 * np.sin(0.4 * stamps - 0.8)
    path = _bending(np.sin(np.arange(1400) * SAMPLE_SPACING / 60.0) / 700.0)
    return _along("traffic", path, stamps, _way(speed), spacing, scene="avenue")


def thinned(drive: Drive, every: int) -> Drive:
    """Keep every `every`-th frame, with its stamp."""
    return replace(drive, stamps=drive.stamps[::every], position=drive.position[::every], yaw=drive.yaw[::every])


def from_file(path: Path, spacing: float | None = None) -> Drive:
    """Create a drive along the poses of a KITTI file, at ten per second, or of a TUM file; `spacing` as in `built_in`.

    The direction of motion shows whether the poses are of a camera (z forward) or of a LiDAR (x forward).

    Raises:
        InputError: The file is not a trajectory, stands still, or jumps.
    """
    stamps, poses = read_poses(path)
    if len(poses) < 2:
        raise InputError(f"{path}: has one pose; at least two are needed")
    steps = np.diff(poses[:, :3, 3], axis=0)
    length = np.linalg.norm(steps, axis=1)
    if (length > JUMP).any():
        line = int(np.argmax(length > JUMP)) + 1
        raise InputError(
            f"{path}: the poses of lines {line} and {line + 1} are {length[line - 1]:.1f} m apart, too far for one "
            f"frame (at most {JUMP:g} m); cut the file there or repair it"
        )
    if length.sum() < 1.0:
        raise InputError(f"{path}: the poses move {length.sum():.2f} m in all; a drive of at least 1 m is needed")
    poses = _level(poses)
    yaw = np.unwrap(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))
    stamps = np.arange(len(poses)) / RATE if stamps is None else stamps - stamps[0]
    if (np.diff(stamps) <= 0).any():
        line = int(np.argmax(np.diff(stamps) <= 0)) + 2
        raise InputError(f"{path}: the stamp of line {line} is not later than the one before; sort or repair it")
    return _spaced(Drive(path.stem, stamps, poses[:, :3, 3], yaw), spacing)


def _level(poses: Array) -> Array:
    """The poses (N, 4, 4) from the first, x forward and z up, whether they are a camera's or a LiDAR's."""
    poses = se3.inverse(poses[0]) @ poses
    steps = np.diff(poses[:, :3, 3], axis=0)
    ahead = np.einsum("nij,ni->j", poses[:-1, :3, :3], steps)  # the way, in the body's own axes
    if abs(ahead[2]) <= abs(ahead[0]):
        return poses
    turn = np.eye(4)
    turn[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    return turn @ poses @ turn.T


def _lane(corners: Array) -> Array:
    """(N, 2): the right lane of a road along these corners (C, 2), every SAMPLE_SPACING, its curves a car's."""
    direction = np.diff(corners, axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    right = np.column_stack([direction[:, 1], -direction[:, 0]]) * LANE
    at = [corners[0] + right[0]]
    for corner, before, after in zip(corners[1:-1], right[:-1], right[1:], strict=True):
        at.append(corner + before + after)  # streets meet at right angles
    at.append(corners[-1] + right[-1])
    return _rounded(np.array(at), 9.0)


def _rounded(corners: Array, radius: float) -> Array:
    """Corners cut by arcs of that radius, sampled every SAMPLE_SPACING; the curvature grows and falls gradually."""
    dense = [corners[0]]
    for index in range(1, len(corners) - 1):
        before, after = corners[index - 1] - corners[index], corners[index + 1] - corners[index]
        before, after = before / np.linalg.norm(before), after / np.linalg.norm(after)
        centre = corners[index] + radius * (before + after)
        for angle in np.linspace(0, np.pi / 2, 16):
            dense.append(centre - radius * (after * np.cos(angle) + before * np.sin(angle)))
    dense.append(corners[-1])
    points = _resampled(np.array(dense), SAMPLE_SPACING)
    return gaussian_filter1d(points, 2.0 / SAMPLE_SPACING, axis=0)[SMOOTHED:-SMOOTHED]


def _resampled(points: Array, step: float) -> Array:
    """A polyline (N, 2) at equal steps of its length."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.arange(0.0, way[-1], step)
    return np.column_stack([np.interp(at, way, points[:, axis]) for axis in (0, 1)])


def _bending(curvature: Array) -> Array:
    """(N, 2): a line from the origin along x with a curvature [1/m] (N,) at each sample, SAMPLE_SPACING apart."""
    heading = SAMPLE_SPACING * np.cumsum(curvature)
    steps = SAMPLE_SPACING * np.column_stack([np.cos(heading), np.sin(heading)])
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)[:-1]])


def _way(speed: Array) -> Array:
    """(N,) metres come at each frame, at a speed [m/s] (N,) whose changes are smoothed."""
    return np.concatenate([[0.0], np.cumsum(gaussian_filter1d(speed, 4))[:-1]]) / RATE


def _driven(name: str, path: Array, spacing: float | None, tunnel: tuple[float, float] | None = None) -> Drive:
    """A car that slows down before curves and speeds up after them."""
    yaw = np.unwrap(np.arctan2(np.gradient(path[:, 1]), np.gradient(path[:, 0])))
    speed = np.minimum(TOP_SPEED, np.sqrt(SIDEWAYS * SAMPLE_SPACING / np.maximum(np.abs(np.gradient(yaw)), 1e-6)))
    for limited in (speed, speed[::-1]):  # no sudden starts and, in reverse order, no sudden stops
        for index in range(1, len(limited)):
            limited[index] = min(limited[index], np.sqrt(limited[index - 1] ** 2 + 2 * ALONG * SAMPLE_SPACING))
    time = np.concatenate([[0.0], np.cumsum(SAMPLE_SPACING / speed[:-1])])
    stamps = np.arange(0.0, time[-1], 1 / RATE)
    way = np.interp(stamps, time, SAMPLE_SPACING * np.arange(len(path)))
    return _along(name, path, stamps, way, spacing, tunnel=tunnel)


def _along(name: str, path: Array, stamps: Array, way: Array, spacing: float | None, **about: Any) -> Drive:
    """Create the drive with travelled distance `way` (N,) [m] along the path at each stamp; `about`: other fields."""
    samples = SAMPLE_SPACING * np.arange(len(path))
    heading = np.unwrap(np.arctan2(np.gradient(path[:, 1]), np.gradient(path[:, 0])))
    position = np.column_stack([*(np.interp(way, samples, path[:, axis]) for axis in (0, 1)), np.zeros(len(way))])
    return _spaced(Drive(name, stamps, position, np.interp(way, samples, heading), **about), spacing)


def _spaced(drive: Drive, spacing: float | None) -> Drive:
    """A frame every `spacing` metres of the way, at ten frames a second; None: as it is."""
    if spacing is None:
        return drive
    if not 0 < spacing <= JUMP:
        raise InputError(f"a spacing of {spacing:g} m: frames can be up to {JUMP:g} m apart")
    way = drive.way
    moving = np.concatenate([[True], np.diff(way) > 0])
    at = np.arange(0.0, way[-1], spacing)
    columns = [np.interp(at, way[moving], drive.position[moving, axis]) for axis in range(3)]
    yaw = np.interp(at, way[moving], drive.yaw[moving])
    return replace(drive, stamps=np.arange(len(at)) / RATE, position=np.column_stack(columns), yaw=yaw, path=None)


def at_rate(drive: Drive, rate: float) -> Drive:
    """Resample a drive to `rate` frames per second: along its `path`, or else by a monotone interpolation."""
    stamps = np.arange(drive.stamps[0], drive.stamps[-1] + 0.01 / rate, 1 / rate)
    stamps = np.minimum(stamps, drive.stamps[-1])
    position, yaw = (np.asarray(PchipInterpolator(drive.stamps, of)(stamps)) for of in (drive.position, drive.yaw))
    if drive.path is not None:
        poses = drive.path(stamps)
        position[:, :2], yaw = poses[:, :2, 3], np.unwrap(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))
    return replace(drive, stamps=stamps, position=position, yaw=yaw, rate=rate)
