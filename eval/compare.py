"""Comparison of runs and other trajectories of the same sequence: accuracy, map, run times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np

from eval.evaluation import evaluate_poses
from eval.metrics import Metrics
from eval.runs import Row, RunDetails, read_run
from eval.trajectory import Statistics, path_length
from slam.data.errors import InputError

DENSE = ("64", "full")  # the input that the others are compared with, by its number of rings
#: Definitions of the figures, printed with them.
PROTOCOL = {
    "ATE, RPE": "rmse by evo, after loop closure: ATE after SE(3) Umeyama alignment without scale, RPE frame to frame",
    "drift": "KITTI devkit's odometry metric, no alignment",
    "to full": "rmse of positions between the odometry and that on all channels, after SE(3) Umeyama alignment",
    "Table III": "the paper's: RPE of the translation over consecutive frames after SE(3) Umeyama alignment; its own "
    "figures are over 30 pairs: 16 channels max 0.784, mean 0.247, min 0.025, rmse 0.295, std 0.161 m; proposed 1.200, "
    "0.250, 0.024, 0.371, 0.274 m",
    "points per scan": "median of the points passed to the odometry, before downsampling",
    "front end, odometry": "median milliseconds per frame: from the scan as read to the points passed to the odometry, "
    "and from these to the pose",
}
MAX_SPREAD = 0.02  # of the lengths that rows cover of the reference, relative; above it, a note says so
ACCURACY, OF_RUNS = ("ATE, RPE", "drift", "Table III"), ("points per scan", "front end, odometry")  # in PROTOCOL
NO_TRUTH = "no ground truth: no ATE, RPE or drift"
NO_REFERENCE = (
    "no reference: no ATE, RPE or drift; the distances tell which trajectories agree, not which of them is right"
)
DISTANCE = "rmse of positions between two trajectories after loop closure, after SE(3) Umeyama alignment"


@dataclass(frozen=True)
class RunFigures:
    """Figures of one run or trajectory in a comparison.

    Those that need ground truth are None without it; those about scans, loops, map and times are None for the
    trajectory of another system.

    Attributes:
        ate_m: ATE of the trajectory after loop closure, SE(3) Umeyama-aligned, rmse [m].
        table_iii_m: The error in Table III of the paper [m].
        rpe_m: RPE of the translation over consecutive frames, rmse [m].
        rpe_deg: RPE of the rotation over consecutive frames, rmse [deg].
        drift_percent: KITTI's translation drift [%], also None if no segment fits.
        drift_deg_per_100m: KITTI's rotation drift [deg/100 m], also None if no segment fits.
        drift_name: Segments that the drift is averaged over.
        notes: Sentences to be printed with the figures.
        path_m: Length of the estimated path [m].
        frames: Number of poses; of a run, number of scans that were read.
        failed: Number of scans that could not be registered.
        loops: Number of accepted loop closures.
        map_points: Number of points of the map.
        points_per_scan: Median number of points passed to the odometry.
        front_end_ms: Median time from the scan as read to these points [ms].
        odometry_ms: Median time from these points to the pose [ms].
        to_full_m: Rmse of positions between this odometry and that on all channels, SE(3) Umeyama-aligned [m]; None
            for the run on all channels itself, and without one.
    """

    ate_m: float | None
    table_iii_m: Statistics | None
    rpe_m: float | None
    rpe_deg: float | None
    drift_percent: float | None
    drift_deg_per_100m: float | None
    drift_name: str | None
    notes: tuple[str, ...]
    path_m: float
    frames: int
    failed: int | None = None
    loops: int | None = None
    map_points: int | None = None
    points_per_scan: int | None = None
    front_end_ms: float | None = None
    odometry_ms: float | None = None
    to_full_m: float | None = None


@dataclass(frozen=True)
class Comparison:
    """Content of compare.json.

    Attributes:
        inputs: Figures of each run by its input, "16", "enriched", and "64" or "full"; or of each trajectory by its
            label.
        protocol: Definition of each figure, to be printed with it.
        kind: Whether inputs of one data set are compared, or finished runs and other trajectories.
        distances_m: Rmse of positions between every two trajectories by their labels, SE(3) Umeyama-aligned [m]; empty
            for a comparison of inputs.
        reference: Name of the reference, None without; not set for a comparison of inputs.
        notes: Notes on the whole comparison.
    """

    inputs: Mapping[str, RunFigures]
    protocol: Mapping[str, str]
    kind: Literal["inputs", "trajectories"] = "inputs"
    distances_m: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    reference: str | None = None
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON."""
        content: dict[str, Any] = {"inputs": {name: asdict(figures) for name, figures in self.inputs.items()}}
        if self.kind == "trajectories":
            content |= {"reference": self.reference, "distances_m": self.distances_m, "notes": list(self.notes)}
        return content | {"protocol": dict(self.protocol)}


def compare_runs(folders: Mapping[str, Path]) -> Comparison:
    """Compare runs on the same sequence.

    Args:
        folders: The run folder of each input ("16", "enriched", and "64" or "full").

    Returns:
        The figures of each input, in the order of `folders`.

    Raises:
        InputError: A folder does not hold a complete run.
    """
    rows = {name: read_run(name, folder) for name, folder in folders.items()}
    runs = {name: row.run for name, row in rows.items() if row.run}
    inputs = {name: _figures(run, rows[name].metrics) for name, run in runs.items()}
    for dense in runs.keys() & set(DENSE):
        for name in inputs.keys() - {dense}:
            off = evaluate_poses(runs[name].odometry.poses, runs[dense].odometry.poses).ate.aligned.rmse
            inputs[name] = replace(inputs[name], to_full_m=off)
    return Comparison(inputs, _protocol(inputs))


def compare_rows(rows: Sequence[Row], reference: str | None, notes: Sequence[str] = ()) -> Comparison:
    """Compare finished runs and trajectories of other systems, of the same sequence and in the same body frame.

    Args:
        rows: The rows, with their figures against the reference.
        reference: Name of the reference, None without.
        notes: Notes on the whole comparison.

    Returns:
        The figures of each row, and the distances between every two.

    Raises:
        InputError: Two of the trajectories cannot be associated, and there is no reference.
    """
    inputs = {row.label: _figures(row.run, row.metrics) if row.run else _figures_of_track(row) for row in rows}
    paths = [row.metrics.reference_path_length_m for row in rows if row.metrics]
    if paths and max(paths) - min(paths) > MAX_SPREAD * max(paths):
        covered = ", ".join(f"{row.label} {row.metrics.reference_path_length_m:.1f} m" for row in rows if row.metrics)
        notes = (*notes, f"the trajectories cover different parts of the reference, so their errors differ: {covered}")
    if reference is None:
        inputs = {label: replace(figures, notes=_without_truth(figures.notes)) for label, figures in inputs.items()}
        notes = (NO_REFERENCE, *notes)
    missing = ("to full", *(() if reference else ACCURACY), *(() if any(row.run for row in rows) else OF_RUNS))
    protocol = {name: text for name, text in _protocol(inputs).items() if name not in missing} | {"distance": DISTANCE}
    return Comparison(inputs, protocol, "trajectories", _distances(rows), reference, tuple(notes))


def _without_truth(notes: Sequence[str]) -> tuple[str, ...]:
    """Notes other than that there is no ground truth, which is said once for all rows."""
    return tuple(note for note in notes if note != NO_TRUTH)


def _distances(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """Distances between every two trajectories; with a reference, those that cannot be associated are left out."""
    found: dict[str, dict[str, float]] = {row.label: {} for row in rows}
    for one, other in combinations(rows, 2):
        try:
            metrics = evaluate_poses(one.track.poses, other.track.poses, one.track.stamps, other.track.stamps)
        except InputError as error:
            if one.metrics and other.metrics:
                continue
            raise InputError(f"{one.label} and {other.label}: {error}") from error
        found[one.label][other.label] = found[other.label][one.label] = metrics.ate.aligned.rmse
    return found


def _protocol(inputs: Mapping[str, RunFigures]) -> dict[str, str]:
    segments = sorted({figures.drift_name for figures in inputs.values() if figures.drift_name})
    return PROTOCOL | {"drift": "; ".join([PROTOCOL["drift"], *segments])}


def _figures_of_track(row: Row) -> RunFigures:
    poses = row.track.poses
    return RunFigures(**_accuracy(row.metrics), path_m=path_length(poses), frames=len(poses))


def _figures(run: RunDetails, metrics: Metrics | None) -> RunFigures:
    report, accuracy = run.report, _accuracy(metrics)
    try:
        times = report["timings_ms"]
        return RunFigures(
            **accuracy | {"notes": (*accuracy["notes"], *report.get("notes", ()))},
            path_m=report["path_length_m"],
            frames=report["counts"]["frames"],
            failed=report["counts"]["failed"],
            loops=report["loops"]["accepted"],
            map_points=report["map_points"],
            points_per_scan=round(float(np.median(run.frames.points))),
            front_end_ms=times["front_end"]["median"],
            odometry_ms=times["odometry"]["median"],
        )
    except (ValueError, TypeError, KeyError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise InputError(f"{run.folder}: not a complete run ({reason}); run it again") from error


def _accuracy(metrics: Metrics | None) -> dict[str, Any]:
    """The figures against ground truth."""
    if metrics is None:
        names = ("ate_m", "table_iii_m", "rpe_m", "rpe_deg", "drift_percent", "drift_deg_per_100m", "drift_name")
        return {**dict.fromkeys(names), "notes": (NO_TRUTH,)}
    drift = metrics.drift
    return {
        "ate_m": metrics.ate.aligned.rmse,
        "table_iii_m": metrics.paper_table_iii,
        "rpe_m": metrics.rpe.frame.rmse,
        "rpe_deg": metrics.rpe.frame_rotation.rmse,
        "drift_percent": drift.translation_percent,
        "drift_deg_per_100m": drift.rotation_deg_per_100m,
        "drift_name": drift.name,
        "notes": (*metrics.notes, *([f"no drift, {drift.reason}"] if drift.reason else [])),
    }
