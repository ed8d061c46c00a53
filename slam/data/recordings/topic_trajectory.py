"""The trajectory that a topic of a recording holds, of any system that publishes its poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.recordings.choice import cloud_topic, mounting_of
from slam.data.recordings.clock import stamped
from slam.data.recordings.clouds import CLOUDS
from slam.data.recordings.messages import PATH
from slam.data.recordings.recording import TRUTH_TYPES, Recording, Topic, recordings_at
from slam.data.recordings.truth import message_poses, mounted, path_poses
from slam.data.yaml_files import suggest


def topic_trajectory(path: Path, name: str | None = None) -> tuple[Array, Array, tuple[str, ...]]:
    """Read the poses of a topic (Odometry, PoseStamped, PoseWithCovarianceStamped, Path).

    Poses of a frame that the recording fixes to the LiDAR are transformed into the LiDAR's poses.

    Args:
        path: The recording, a file or its folder.
        name: Name of the topic. Default: the only one with poses.

    Returns:
        Stamps (N,) [s], increasing; poses (N, 4, 4); and notes.

    Raises:
        InputError: The recording cannot be read, or has no such topic with at least two poses.
    """
    found = recordings_at(path)
    if "" not in found:
        raise InputError(f"{path}: holds several recordings; name one: {', '.join(found)}")
    recording = Recording(path, found[""])
    topic = _chosen(recording, name)
    where = f"{path}:{topic.name}"
    if topic.type == PATH:
        stamps, poses, body = path_poses(recording, topic)
    else:
        messages, poses, body = message_poses(recording, topic)
        stamps = messages.stamps
    T_body_lidar, problems = mounted(mounting_of(recording), body, _lidar_frame(recording), where)
    sound = np.isfinite(stamps) & np.isfinite(poses).all(axis=(1, 2))
    stamps, first = np.unique(stamps[sound], return_index=True)
    if len(stamps) < 2:
        raise InputError(f"{where}: fewer than two poses that differ in time")
    notes = tuple(problem.message for problem in problems)
    return stamps, poses[sound][first] @ T_body_lidar, notes


def _chosen(recording: Recording, name: str | None) -> Topic:
    known = {topic.name: topic for topic in recording.of_type(*TRUTH_TYPES)}
    if name is None:
        if len(known) == 1:
            return next(iter(known.values()))
        listed = " or ".join(f"{recording.path}:{topic}" for topic in known)
        fault = f"has several topics with poses; name one: {listed}" if known else "has no topic with poses"
        raise InputError(f"{recording.path}: {fault}")
    for spelt in (name, f"/{name}"):
        if spelt in known:
            return known[spelt]
    fault = "no such topic"
    if other := recording.topics.get(name) or recording.topics.get(f"/{name}"):
        fault = f"holds {other.type}, not poses"
    raise InputError(f"{recording.path}:{name}: {fault}{suggest(name, list(known)) if known else ''}")


def _lidar_frame(recording: Recording) -> str:
    """The frame of the scans, '' without scans."""
    if not recording.of_type(*CLOUDS):
        return ""
    topic, _ = cloud_topic(recording, None)
    return stamped(recording, topic.name, np.arange(min(topic.count, 2))).frame
