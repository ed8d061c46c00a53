"""A finished run in the viewer rerun: its scans from the data set, enriched again, at the poses of the run folder."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from pydantic import ValidationError

from eval.runs import Row, RunDetails, read_run, read_truth
from lidarlift.front_ends import front_end_for
from lidarlift.reporting import Reporter
from lidarlift.watching.rerun_log import RerunLog
from slam.data import se3
from slam.data.cloud import HISTORY, Array, Frame, PointCloud
from slam.data.dataset import open_dataset, ring_count
from slam.data.distortion import correct_vertical, deskew
from slam.data.errors import InputError
from slam.data.point_files import read_cloud
from slam.data.sensor_names import SENSORS
from slam.records import FrameRecord
from slam.settings import FrontEndSettings

if TYPE_CHECKING:
    from slam.data.dataset import Dataset, DatasetOptions

SAME_STAMP = 1e-6  # s, rounding of the trajectory file
TOPICS = {"points": "topic", "images": "image_topic"}  # options of `open_dataset` by their use
MAX_FRAMES = 300  # with scans, evenly over the run, unless frames are stated


def log_finished(
    folder: Path,
    log: RerunLog,
    frames: slice | None,
    reporter: Reporter,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    **options: Unpack[DatasetOptions],
) -> None:
    """Log a run folder.

    Without the data set, map, trajectory and loops are logged alone, and a note says so.

    Args:
        folder: The run folder.
        log: Receives everything.
        frames: Frames of the run whose scans are logged. Default: at most MAX_FRAMES, evenly.
        reporter: Receives progress and notes.
        sequence: As in `open_dataset`, like the two below, where the run had them and run.json does not say so.
        sensor: The LiDAR.
        **options: How the data set is read.

    Raises:
        InputError: The folder does not hold a complete run, or `frames` selects none.
    """
    row = read_run(folder.resolve().name, folder)
    assert row.run is not None
    count = len(row.track.poses)
    chosen = range(count)[frames or slice(None, None, max(1, -(-count // MAX_FRAMES)))]
    if not chosen:
        raise InputError(f"--frames: selects none of the {count} frames of {folder}")
    if frames is None and chosen.step > 1:
        reporter.note(f"one in {chosen.step} of {count} frames is shown with its scan; --frames FROM:TO chooses others")
    truth = read_truth(folder)
    log.log_truth(truth.poses if truth else None)
    with reporter.progress(row.label, len(chosen)) as advance:
        try:
            data = _data_set(row.run.report["protocol"], sequence, sensor, options)
            for frame, cloud, record in _scans(data, row, row.run, chosen):
                log.registered(frame, cloud, record)
                advance()
        except InputError as error:
            reporter.note(f"shown without scans: {error}")
    place = {int(number): position for position, number in enumerate(row.run.frames.numbers)}
    loops = [(place[loop.i], place[loop.j]) for loop in row.run.loops if loop.accepted]
    log.log_result(row.run.odometry.poses, row.track.poses, loops, _map(folder))


def _scans(data: Dataset, row: Row, run: RunDetails, chosen: range) -> Iterator[tuple[Frame, PointCloud, FrameRecord]]:
    """The scans as they were registered: enriched, deskewed, corrected."""
    protocol, track, frames = run.report["protocol"], row.track, run.frames
    assert track.stamps is not None
    positions = range(*protocol["frames"])
    same = len(positions) == len(track.poses) and positions[-1] < len(data)
    if not same or np.abs(data.stamps[positions] - track.stamps).max() > SAME_STAMP:
        raise InputError(f"{data.path}: its frames are not those of the run; state the options that the run had")
    front_end = front_end_for(_settings(protocol), data.sensor, data.name, ring_count(data))
    angle = np.deg2rad(protocol["vertical_correction_deg"])
    recent: deque[tuple[PointCloud, Array]] = deque(maxlen=HISTORY)
    for k in chosen:
        frame, pose = data[positions[k]], track.poses[k]
        now_world = se3.inverse(pose)
        cloud = front_end(frame, [(then, now_world @ at) for then, at in recent])
        recent.append((cloud, pose))
        scan = deskew(cloud, _velocity(track.stamps, track.poses, k)) if protocol["deskew"] else cloud
        milliseconds = {stage: float(values[k]) for stage, values in frames.milliseconds.items()}
        figures = frames.status[k], float(frames.inlier_ratio[k]), int(frames.points[k]), milliseconds
        record = FrameRecord(frame.index, float(track.stamps[k]), pose, np.zeros((6, 6)), *figures)
        yield frame, correct_vertical(scan, angle), record


def _settings(protocol: Mapping[str, Any]) -> FrontEndSettings:
    """Settings of the front end, which another version may have had under other names."""
    try:
        return FrontEndSettings.model_validate(protocol["config"]["front_end"])
    except ValidationError as error:
        names = ", ".join(".".join(map(str, fault["loc"])) for fault in error.errors())
        raise InputError(f"the run is of another version, with other settings (front_end: {names})") from error


def _data_set(
    protocol: Mapping[str, Any], sequence: str | None, sensor: str | Path | None, options: DatasetOptions
) -> Dataset:
    """The data set of a run, which must be where it was, as the run and the options say."""
    path, model = protocol["path"], protocol["sensor"]
    if path is None:
        raise InputError("a live run, whose scans were not kept")
    topics = {option: protocol["topics"].get(use) for use, option in TOPICS.items()}
    given: Any = topics | {option: value for option, value in options.items() if value is not None}
    return open_dataset(path, sequence, sensor or (model if model in SENSORS.names() else None), **given)


def _velocity(stamps: Array, poses: Array, k: int) -> Array:
    """Velocity (6,) [rad/s, m/s] at a frame, from the frame before."""
    before, after = max(k - 1, 0), min(max(k, 1), len(poses) - 1)
    elapsed = float(stamps[after] - stamps[before])
    if not elapsed > 0:  # a single frame, or stamps that repeat
        return np.zeros(6)
    return se3.log(se3.normalized(se3.inverse(poses[before]) @ poses[after])) / elapsed


def _map(folder: Path) -> PointCloud:
    """The map of a run, empty without one."""
    path = folder / "map.pcd"
    if not path.is_file():
        return PointCloud(np.zeros((0, 3)), np.zeros(0))
    points = read_cloud(path)
    return PointCloud(points.xyz, np.zeros(len(points.xyz)), colour=points.colour)
