"""Runs and trajectories that are compared or reported: a row each, read from files."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eval.evaluation import evaluate_poses
from eval.loops import Loop, read_loops
from eval.metrics import Metrics, RunMetrics
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import read_poses


@dataclass(frozen=True, eq=False)
class Track:
    """A trajectory.

    Attributes:
        poses: (N, 4, 4) T_world_lidar [m].
        stamps: (N,) [s], None if unknown.
    """

    poses: Array
    stamps: Array | None = None


@dataclass(frozen=True, eq=False)
class Frames:
    """Content of timings.csv, about N frames.

    Attributes:
        numbers: (N,) int, number of each frame in its data set.
        status: 'registered', 'retried', 'degenerate' or 'failed', for each frame.
        unobserved: (N,) int, number of directions that the scan did not constrain, 0 to 6.
        inlier_ratio: (N,) share of the matched points that fit the map, NaN where nothing was registered.
        points: (N,) int, number of points passed to the odometry.
        milliseconds: Run time (N,) [ms] by the name of the stage.
    """

    numbers: Array
    status: tuple[str, ...]
    unobserved: Array
    inlier_ratio: Array
    points: Array
    milliseconds: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class RunDetails:
    """What a run folder of lidarlift has beside its trajectory.

    Attributes:
        folder: The run folder.
        report: Content of run.json.
        odometry: The trajectory before loop closure.
        odometry_metrics: Its figures against the ground truth, None without.
        frames: What happened to each frame.
        loops: All loop candidates with their status.
        nees: NEES of the poses per degree of freedom, see `eval.consistency`; None where it is unknown.
    """

    folder: Path
    report: Mapping[str, Any]
    odometry: Track
    odometry_metrics: Metrics | None
    frames: Frames
    loops: tuple[Loop, ...]
    nees: float | None = None


@dataclass(frozen=True, eq=False)
class Row:
    """A run, or the trajectory of another system.

    Attributes:
        label: Name in tables and legends: "16", "enriched", "64", "KISS-ICP".
        track: The trajectory; of a run, after loop closure.
        metrics: Its figures against the ground truth, None without.
        run: The rest of the run folder, None for the trajectory of another system.
    """

    label: str
    track: Track
    metrics: Metrics | None = None
    run: RunDetails | None = None


def read_run(label: str, folder: Path) -> Row:
    """Read a run folder.

    Args:
        label: The row's name.
        folder: A folder that a finished run has written.

    Raises:
        InputError: The folder does not hold a complete run.
    """
    try:
        file = folder / "metrics.json"
        metrics = RunMetrics.from_dict(_json(file)) if file.exists() else None
        details = RunDetails(
            folder,
            _json(folder / "run.json"),
            read_track(folder / "odometry_tum.txt"),
            metrics.odometry if metrics else None,
            _frames(folder / "timings.csv"),
            read_loops(folder / "loops.csv"),
            metrics.nees.pose if metrics and metrics.nees else None,
        )
        return Row(label, read_track(folder / "trajectory_tum.txt"), metrics.slam if metrics else None, details)
    except (OSError, ValueError, TypeError, KeyError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise InputError(f"{folder}: not a complete run ({reason}); run it again") from error


def read_truth(folder: Path) -> Track | None:
    """Return the ground truth in a run folder, None without.

    Raises:
        InputError: The file is damaged.
    """
    path = folder / "ground_truth_tum.txt"
    return read_track(path) if path.is_file() else None


def read_track(path: Path) -> Track:
    """Read a trajectory that a run has written, in TUM format.

    Raises:
        InputError: The file is missing or damaged.
    """
    stamps, poses = read_poses(path, "xyzw")
    return Track(poses, stamps)


def track_row(label: str, track: Track, truth: Track | None) -> Row:
    """Return the row of another system's trajectory.

    Args:
        label: The row's name.
        track: LiDAR poses. Without stamps they must be as many as those of the ground truth.
        truth: The ground truth, None without.

    Raises:
        InputError: The trajectory and the ground truth cannot be associated.
    """
    if truth is None:
        return Row(label, track)
    try:
        return Row(label, track, evaluate_poses(track.poses, truth.poses, track.stamps, truth.stamps))
    except InputError as error:
        raise InputError(f"{label}: {error}") from error


def _json(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8")))


def _frames(path: Path) -> Frames:
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        raise ValueError(f"{path.name} has no frames")
    stages = [name for name in rows[0] if name.endswith("_ms")]
    return Frames(
        numbers=np.array([int(row["frame"]) for row in rows]),
        status=tuple(row["status"] for row in rows),
        unobserved=np.array([_count(row["unobserved_along"]) + _count(row["unobserved_about"]) for row in rows]),
        inlier_ratio=_column(rows, "inlier_ratio"),
        points=np.array([int(row["points"]) for row in rows]),
        milliseconds={stage.removesuffix("_ms"): _column(rows, stage) for stage in stages},
    )


def _column(rows: Sequence[Mapping[str, str]], name: str) -> Array:
    return np.array([float(row[name]) for row in rows])


def _count(vectors: str) -> int:
    """Number of vectors in a cell of timings.csv, where they are separated by semicolons."""
    return len(vectors.split(";")) if vectors else 0
