"""Trajectories by what a user names: run folders, trajectory files and topics of recordings, and their reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

import numpy as np

from eval.evaluation import other_order
from eval.runs import Row, Track, read_run
from slam.data.body_frame import body_frame, into_lidar_frame
from slam.data.cloud import Array
from slam.data.dataset import DatasetOptions, open_dataset
from slam.data.errors import InputError
from slam.data.pose_files import Trajectory, read_whole_trajectory, w_first_note
from slam.data.recordings.recording import CONTAINERS
from slam.data.recordings.topic_trajectory import topic_trajectory

KNOWN = "a run folder, a trajectory (KITTI, TUM or EuRoC format), or a topic of a recording (drive.bag:/odom)"


@dataclass(frozen=True)
class Source:
    """A trajectory that a user names, as [LABEL=]PATH[:TOPIC].

    Attributes:
        path: A run folder, a trajectory file, or a recording.
        topic: Topic of the recording, None if not stated.
        label: Name of the row.
    """

    path: Path
    topic: str | None = None
    label: str = ""

    @property
    def is_run(self) -> bool:
        """Whether it is the folder of a finished run."""
        return (self.path / "run.json").is_file()

    @property
    def is_recording(self) -> bool:
        """Whether it is a recording of ROS messages."""
        if not self.path.is_dir():
            return self.path.suffix.lower() in CONTAINERS
        return not self.is_run and any(file.suffix.lower() in CONTAINERS for file in self.path.iterdir())


@dataclass(frozen=True, eq=False)
class Named:
    """A trajectory with its notes.

    Attributes:
        row: The row, without figures.
        notes: Assumptions about it, in sentences.
        file: The trajectory as its file has it; None for a run and a recording.
        T_camera0_lidar: (4, 4) KITTI's calibration in a run's report, None without.
    """

    row: Row
    notes: tuple[str, ...] = ()
    file: Trajectory | None = None
    T_camera0_lidar: Array | None = None


def source_of(text: str) -> Source:
    """Return the trajectory that [LABEL=]PATH[:TOPIC] names; a path that exists as it stands is one.

    Raises:
        InputError: There is nothing at this path.
    """
    for label, rest in (("", text), *([text.split("=", 1)] if "=" in text else [])):
        if Path(rest).expanduser().exists():
            return Source(Path(rest).expanduser(), None, label)
        path, colon, topic = rest.partition(":")
        if colon and Path(path).expanduser().exists():
            return Source(Path(path).expanduser(), topic, label)
    raise InputError(f"{text}: no such file or folder; give {KNOWN}, as PATH or LABEL=PATH")


def labelled(sources: Sequence[Source]) -> list[Source]:
    """Give each source a label of its own: the stated one, else the last parts of its path that differ.

    Raises:
        InputError: Two sources have the same label.
    """
    names = [source.label or _name(source, 1) for source in sources]
    for parts in range(2, 5):
        repeated = {name for name in names if names.count(name) > 1}
        names = [
            _name(source, parts) if name in repeated and not source.label else name
            for source, name in zip(sources, names, strict=True)
        ]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{name}: two trajectories have this name; name them LABEL=PATH")
    return [replace(source, label=name) for source, name in zip(sources, names, strict=True)]


def _name(source: Source, parts: int) -> str:
    """Name by the last parts of the path, and the topic."""
    path = source.path.resolve()
    path = path if path.is_dir() else path.with_suffix("")
    name = "/".join(path.parts[-parts:])
    topic = (source.topic or "").strip("/")
    return topic if topic and parts == 1 else f"{name}:{topic}" if topic else name


def read_source(source: Source) -> Named:
    """Read a trajectory.

    Raises:
        InputError: It is none of the known kinds, or damaged.
    """
    path = source.path
    if source.is_run:
        if source.topic is not None:
            raise InputError(f"{path}:{source.topic}: is a run folder, which has no topics; leave :{source.topic} out")
        row = read_run(source.label, path)
        matrix = row.run.report.get("T_camera0_lidar") if row.run else None
        return Named(row, T_camera0_lidar=None if matrix is None else np.array(matrix, float))
    if source.is_recording:
        stamps, poses, notes = topic_trajectory(path, source.topic)
        return Named(Row(source.label, Track(poses, stamps)), notes)
    if source.topic is not None:
        raise InputError(f"{path}: is not a recording (.bag, .db3, .mcap), so it has no topic {source.topic}")
    if path.is_dir():
        raise InputError(f"{path}: {_about_folder(path)}")
    found = read_whole_trajectory(path)
    note = w_first_note(path, found)
    return Named(Row(source.label, Track(found.poses, found.stamps)), () if note is None else (note,), found)


def _about_folder(path: Path) -> str:
    """Say why a folder is no run, and what to do."""
    rows = sorted(str(folder) for folder in path.iterdir() if (folder / "run.json").is_file())
    if rows:
        return f"holds several runs; name those that are compared: {' '.join(rows)}"
    if (path / "odometry_tum.txt").is_file():
        return "a run that was stopped (no run.json); finish it, or compare its odometry_tum.txt"
    return f"neither a finished run (no run.json) nor a recording; give {KNOWN}; a data set is compared alone"


def read_reference(
    text: str, sequence: str | None = None, sensor: str | Path | None = None, **options: Unpack[DatasetOptions]
) -> Named:
    """Read the reference: a trajectory as in `read_source`, or the ground truth of a data set or of a run.

    Args:
        text: Its path; a recording with :TOPIC for the trajectory of that topic.
        sequence: Name of the sequence, if the data set has several.
        sensor: As in `open_dataset`, for a data set.
        **options: Likewise.

    Raises:
        InputError: It cannot be read, or the data set has no ground truth.
    """
    source = replace(source_of(text), label="reference")
    given = {"sequence": sequence, "sensor": sensor, **options}
    if source.topic is not None or source.is_run or (source.path.is_file() and not source.is_recording):
        if chosen := [name for name, value in given.items() if value is not None]:
            option = f"--{chosen[0].replace('_', '-')}"
            raise InputError(f"{text}: {option} is for a data set as reference; leave it out")
        return read_source(source)
    data = open_dataset(source.path, sequence, sensor, **options)
    truth = data.ground_truth
    if truth is None:
        reason = next((problem.message for problem in data.problems if "truth" in problem.kind), "")
        raise InputError(f"{text}: has no ground truth{f' ({reason})' if reason else ''}; give another reference")
    known = np.isfinite(truth).all(axis=(1, 2))
    return Named(Row(f"ground truth of {data.name}", Track(truth[known], data.stamps[known])))


def as_estimate_tells(reference: Named, estimate: Track, T_camera0_lidar: Array | None) -> Named:
    """Read the quaternions of a reference file in the order that an estimate agrees with, and note it."""
    if reference.file is None:
        return reference
    T = T_camera0_lidar if body_frame(reference.file.poses) == "camera" else None
    order = other_order(reference.file, estimate.stamps, estimate.poses, T)
    if order is None:
        return reference
    note = f"judging by the estimates, its quaternions have w {'first' if order == 'wxyz' else 'last'}"
    track = Track(reference.file.readings[order], reference.file.stamps)
    return replace(reference, row=replace(reference.row, track=track), notes=(note,))


def in_lidar_frame(trajectories: Sequence[Named], T_camera0_lidar: Array | None, calibrated_by: str) -> list[Named]:
    """Transform trajectories of a camera into the LiDAR frame, unless all that are recognised are of a camera.

    Args:
        trajectories: Estimates and reference.
        T_camera0_lidar: (4, 4) calibration, None without.
        calibrated_by: Its origin, for the notes.

    Raises:
        InputError: Body frames differ and there is no calibration.
    """
    frames = [body_frame(each.row.track.poses) for each in trajectories]
    cameras = [each for each, frame in zip(trajectories, frames, strict=True) if frame == "camera"]
    lidars = [each for each, frame in zip(trajectories, frames, strict=True) if frame == "lidar"]
    if not cameras or not lidars:
        return list(trajectories)
    if T_camera0_lidar is None:
        raise InputError(
            f"{lidars[0].row.label} is a LiDAR trajectory (moves forward along x), {cameras[0].row.label} one of "
            "camera 0 (along z): errors between different body frames are meaningless; give the calibration with "
            "--calib calib.txt"
        )
    note = f"poses of camera 0, transformed into the LiDAR frame by {calibrated_by}"
    return [
        _transformed(each, T_camera0_lidar, note) if frame == "camera" else each
        for each, frame in zip(trajectories, frames, strict=True)
    ]


def _transformed(named: Named, T_camera0_lidar: Array, note: str) -> Named:
    track = replace(named.row.track, poses=into_lidar_frame(named.row.track.poses, T_camera0_lidar))
    return replace(named, row=replace(named.row, track=track), notes=(*named.notes, note))
