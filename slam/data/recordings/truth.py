"""Ground truth in a recording: Odometry, poses, a Path, or positions by GNSS."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.geodesy import east_north_up
from slam.data.ground_truth import GroundTruth, truth_of
from slam.data.point_blocks import UnreadableError
from slam.data.pose_files import Trajectory
from slam.data.problem import Problem
from slam.data.recordings.clock import Stamped, stamped
from slam.data.recordings.messages import FIX, ODOMETRY, PATH, POSE_WITH_COVARIANCE
from slam.data.recordings.recording import Recording, Topic
from slam.data.recordings.transforms import Mounting, pose_of

ARM = 0.1  # m between antenna and LiDAR that are said, of the order of the error of a good fix
MARGIN = 30.0  # s of poses before and after the scans that are used, more than between two of any receiver


@dataclass(frozen=True, eq=False)
class RecordedTruth:
    """Ground truth of the scans, as far as a recording has it.

    Attributes:
        poses: (N, 4, 4) T_world_lidar, the first known one the identity, NaN where unknown; None without any.
        positions: (N, 3) [m] of the LiDAR in a world whose orientation is unknown, the first known one zero, NaN where
            unknown; None unless positions are all that is known.
        problems: What is wrong with it.
    """

    poses: Array | None = None
    positions: Array | None = None
    problems: tuple[Problem, ...] = ()


@dataclass(frozen=True, eq=False)
class TruthOf:
    """The scans whose ground truth is wanted.

    Attributes:
        found: The scans, with clock and frame.
        stamps: (N,) [s].
        numbers: (N,) int64.
        recorded: When the first and the last were recorded [ns].
    """

    found: Stamped
    stamps: Array
    numbers: Array
    recorded: tuple[int, int]


def read_truth(recording: Recording, topic: Topic, scans: TruthOf, mounting: Mounting) -> RecordedTruth:
    """Read the ground truth of scans from a topic of poses or of GNSS fixes.

    Scans beyond the poses, and those between poses that are too far apart, have none, as in `truth_of`.

    Args:
        recording: The recording.
        topic: The topic.
        scans: The scans.
        mounting: How the frames are mounted to each other.
    """
    where = f"{recording.path}: {topic.name}"
    margin = int(MARGIN * 1e9)
    times = recording.times(topic.name)
    numbers = np.flatnonzero((times >= scans.recorded[0] - margin) & (times <= scans.recorded[1] + margin))
    if topic.type == FIX:
        return _positions(recording, topic, numbers, scans, mounting)
    if topic.type == PATH:
        stamps, poses, body = path_poses(recording, topic)
    else:
        found, poses, body = message_poses(recording, topic, numbers)
        stamps = found.on(scans.found)
    T_body_lidar, problems = mounted(mounting, body, scans.found.frame, where)
    truth = _at_scans(where, stamps, poses, scans)
    lidar = None if truth.poses is None else se3.from_first(truth.poses @ T_body_lidar)
    return RecordedTruth(lidar, problems=(*problems, *truth.problems))


def _at_scans(where: str, stamps: Array, poses: Array, scans: TruthOf) -> GroundTruth:
    """The truth (N, 4, 4) of the scans by poses (M, 4, 4) at stamps (M,) [s]."""
    sound = np.isfinite(stamps) & np.isfinite(poses).all(axis=(1, 2))
    trajectory = Trajectory(poses[sound], np.flatnonzero(sound), stamps[sound])
    return truth_of(Path(where), trajectory, scans.stamps, scans.numbers, known_times=True)


def _positions(recording: Recording, topic: Topic, numbers: Array, scans: TruthOf, mounting: Mounting) -> RecordedTruth:
    """The positions by GNSS fixes (NavSatFix)."""
    where = f"{recording.path}: {topic.name}"
    found = stamped(recording, topic.name, numbers)
    places, sigma = np.full((len(numbers), 3), np.nan), list[float]()
    for at, number in enumerate(numbers.tolist()):
        try:
            message = recording.message(topic.name, number)
        except UnreadableError:
            continue
        if message.status.status >= 0:  # -1: no fix
            places[at] = message.latitude, message.longitude, message.altitude
            sigma.append(float(np.sqrt(max(message.position_covariance[0], 0))))
    known = np.isfinite(places).all(axis=1)
    poses = np.full((len(places), 4, 4), np.nan)
    if known.any():
        poses[known] = np.eye(4)
        poses[known, :3, 3] = east_north_up(places[known])
    truth = _at_scans(where, found.on(scans.found), poses, scans)
    if truth.poses is None:
        return RecordedTruth(problems=truth.problems)
    text = f"{where}: the ground truth has positions only, by GNSS; rotation is not compared"
    if sigma and np.median(sigma) > 0:
        text += f"; sigma of the receiver {np.median(sigma):.2g} m"
    T = mounting.between(found.frame, scans.found.frame) if found.frame else None
    if T is not None and (arm := float(np.linalg.norm(T[:3, 3]))) > ARM:
        text += f"; the antenna is {arm:.2f} m from the LiDAR, which is not corrected"
    problems = (*truth.problems, Problem("positions as ground truth", text))
    return RecordedTruth(positions=truth.poses[:, :3, 3], problems=problems)


def message_poses(recording: Recording, topic: Topic, numbers: Array | None = None) -> tuple[Stamped, Array, str]:
    """Read the poses of a topic with a pose in each message.

    Args:
        recording: The recording.
        topic: The topic.
        numbers: (M,) int64, the messages that are read, None for all.

    Returns:
        Stamps (M,), poses (M, 4, 4), NaN where a message cannot be read, and their frame, '' if unknown.
    """
    numbers = np.arange(topic.count) if numbers is None else numbers
    found = stamped(recording, topic.name, numbers)
    poses, body = np.full((len(numbers), 4, 4), np.nan), ""
    for at, number in enumerate(numbers.tolist()):
        try:
            message = recording.message(topic.name, number)
        except UnreadableError:
            continue
        pose = message.pose.pose if topic.type in (ODOMETRY, POSE_WITH_COVARIANCE) else message.pose
        poses[at] = pose_of(pose.position, pose.orientation)
        body = body or (message.child_frame_id.lstrip("/") if topic.type == ODOMETRY else "")
    return found, poses, body


def path_poses(recording: Recording, topic: Topic) -> tuple[Array, Array, str]:
    """Read the poses of a Path, whose last message has the whole path; returns as `message_poses`, with stamps [s]."""
    for number in range(topic.count - 1, -1, -1):
        try:
            found: list[Any] = recording.message(topic.name, number).poses
        except UnreadableError:
            continue
        stamps = [_seconds(each.header.stamp) for each in found]
        poses = [pose_of(each.pose.position, each.pose.orientation) for each in found]
        return np.array(stamps), np.array(poses).reshape(-1, 4, 4), ""
    return np.zeros(0), np.zeros((0, 4, 4)), ""


def _seconds(stamp: Any) -> float:
    return (int(stamp.sec) * 10**9 + int(stamp.nanosec)) / 10**9


def mounted(mounting: Mounting, body: str, lidar: str, where: str) -> tuple[Array, tuple[Problem, ...]]:
    """Return T_body_lidar (4, 4); the identity and a Problem if the recording does not have it.

    Args:
        mounting: How the frames are mounted to each other.
        body: Frame of the poses, '' if unknown.
        lidar: Frame of the scans.
        where: The topic, for the message.
    """
    if body in ("", lidar):
        return np.eye(4), ()
    T = mounting.between(body, lidar)
    if T is not None:
        return T, ()
    text = f"{where}: poses of the frame {body}, and no transform to {lidar}; they are taken for the LiDAR's"
    return np.eye(4), (Problem("unknown frame of truth", text),)
