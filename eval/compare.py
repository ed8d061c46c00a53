"""Comparison of runs on the same sequence: accuracy, map, run times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eval.evaluation import evaluate_poses
from eval.metrics import Metrics
from eval.runs import RunDetails, read_run
from eval.trajectory import Statistics
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


@dataclass(frozen=True)
class RunFigures:
    """Figures of one run in a comparison; those that need ground truth are None without it.

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
        frames: Number of scans that were read.
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
    failed: int
    loops: int
    map_points: int
    points_per_scan: int
    front_end_ms: float
    odometry_ms: float
    to_full_m: float | None = None


@dataclass(frozen=True)
class Comparison:
    """Content of compare.json.

    Attributes:
        inputs: Figures of each run by the name of its input: "16", "enriched", and "64" or "full".
        protocol: Definition of each figure, to be printed with it.
    """

    inputs: Mapping[str, RunFigures]
    protocol: Mapping[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON."""
        return {
            "inputs": {name: asdict(figures) for name, figures in self.inputs.items()},
            "protocol": dict(self.protocol),
        }


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
    segments = sorted({figures.drift_name for figures in inputs.values() if figures.drift_name})
    drift = "; ".join([PROTOCOL["drift"], *segments])
    return Comparison(inputs, PROTOCOL | {"drift": drift})


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
        return {**dict.fromkeys(names), "notes": ("no ground truth: no ATE, RPE or drift",)}
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
