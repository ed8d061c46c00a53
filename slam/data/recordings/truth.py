"""True poses in a recording: Odometry, poses, or a Path."""

from __future__ import annotations

from typing import Any

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.point_blocks import UnreadableError
from slam.data.problem import Problem
from slam.data.recordings.clock import Stamped, stamped
from slam.data.recordings.messages import ODOMETRY, PATH, POSE_WITH_COVARIANCE
from slam.data.recordings.recording import Recording, Topic
from slam.data.recordings.transforms import Mounting, pose_of

#: Poses farther apart than so many of their usual steps, and than HOLE [s], have a hole between them: over it nothing
#: is interpolated.
STEPS, HOLE = 1.5, 0.3
ROUNDING = 1e-3  # s


def read_truth(
    recording: Recording, topic: Topic, clouds: Stamped, stamps: Array, mounting: Mounting
) -> tuple[Array | None, tuple[Problem, ...]]:
    """Poses (N, 4, 4) T_world_lidar at `stamps` (N,) [s] of the scans `clouds`, the first known one the identity, NaN
    where the topic has none; None where it has none at all. And what is wrong with them."""
    where = f"{recording.path}: {topic.name}"
    if topic.type == PATH:
        times, poses, body = path_poses(recording, topic)
    else:
        found, poses, body = message_poses(recording, topic)
        times = found.on(clouds)
    T_body_lidar, problems = mounted(mounting, body, clouds.frame, where)
    sound = np.isfinite(times) & np.isfinite(poses).all(axis=(1, 2))
    order = np.flatnonzero(sound)[np.argsort(times[sound], kind="stable")]
    order = order[np.concatenate([[True], np.diff(times[order]) > 0])[: len(order)]]
    times, poses = times[order], poses[order] @ T_body_lidar
    if len(times) < 2:
        return None, (Problem("no ground truth", f"{where}: fewer than two poses that differ in time; there is none"),)
    before, after, share = se3.neighbours(times, stamps)
    gap = times[after] - times[before]
    near = np.minimum(np.abs(stamps - times[before]), np.abs(stamps - times[after])) <= ROUNDING
    inside = (stamps >= times[0] - ROUNDING) & (stamps <= times[-1] + ROUNDING)
    inside &= near | (gap <= max(STEPS * float(np.median(np.diff(times))), HOLE) + ROUNDING)
    truth = np.full((len(stamps), 4, 4), np.nan)
    truth[inside] = se3.blend(poses[before[inside]], poses[after[inside]], share[inside])
    lost = int((~inside).sum())
    if lost:
        text = f"{where}: {lost} of {len(stamps)} scans lie beyond its poses, or where it has none for some time"
        problems = (*problems, Problem("hole in ground truth", f"{text}; these have no truth"))
    return se3.from_first(truth), problems


def message_poses(recording: Recording, topic: Topic) -> tuple[Stamped, Array, str]:
    """Stamps (M,), poses (M, 4, 4), NaN where a message cannot be read, and their frame, '' if unknown."""
    found = stamped(recording, topic.name, np.arange(topic.count))
    poses, body = np.full((topic.count, 4, 4), np.nan), ""
    for number in range(topic.count):
        try:
            message = recording.message(topic.name, number)
        except UnreadableError:
            continue
        pose = message.pose.pose if topic.type in (ODOMETRY, POSE_WITH_COVARIANCE) else message.pose
        poses[number] = pose_of(pose.position, pose.orientation)
        body = body or (message.child_frame_id.lstrip("/") if topic.type == ODOMETRY else "")
    return found, poses, body


def path_poses(recording: Recording, topic: Topic) -> tuple[Array, Array, str]:
    """The same of a Path, whose last message has all of the way."""
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
    """T_body_lidar (4, 4); where nothing says it, the body is taken for the LiDAR."""
    if body in ("", lidar):
        return np.eye(4), ()
    T = mounting.between(body, lidar)
    if T is not None:
        return T, ()
    text = f"{where}: poses of the frame {body}, and no transform to {lidar}; they are taken for the LiDAR's"
    return np.eye(4), (Problem("unknown frame of truth", text),)
