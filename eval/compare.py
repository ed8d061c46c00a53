"""Runs over the same drive beside each other: accuracy, and what it took."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from statistics import median
from typing import Any

from eval.evaluation import Metrics, evaluate
from eval.trajectory import STATISTICS
from slam.data.errors import InputError
from slam.data.pose_files import read_poses

DENSE = "64"  # the input that the others are held against
#: What the figures of a comparison mean, to be printed beside them.
PROTOCOL = {
    "ATE, RPE": "rmse by evo, loops closed: ATE after SE(3) Umeyama alignment without scale, RPE frame to frame",
    "drift": "KITTI devkit's odometry metric, no alignment",
    "to 64": "rmse of positions between the odometry and that on 64 channels, after SE(3) Umeyama alignment",
    "Table III": "the paper's: RPE of the translation over consecutive frames after SE(3) Umeyama alignment; its own "
    "figures are over 30 pairs: 16 channels max 0.784, mean 0.247, min 0.025, rmse 0.295, std 0.161 m; proposed 1.200, "
    "0.250, 0.024, 0.371, 0.274 m",
    "points a scan": "median of what is handed to the odometry, before it is thinned",
    "front end, odometry": "median milliseconds a frame: from the scan as read to the points handed over, and from "
    "these to the pose",
}


def compare_runs(folders: Mapping[str, Path]) -> dict[str, Any]:
    """What compare.json holds, for the run folder of each input ("16", "enriched", "64"): {"inputs", "protocol"}.

    Each input has its figures, None where there is no ground truth or the drive is too short: `ate_m`, `rpe_m`,
    `rpe_deg`, `drift_percent`, `drift_deg_per_100m` and `drift_name`, `to_64_m`, `path_m`, `frames`, `failed`, `loops`,
    `map_points`, `points_per_scan`, `front_end_ms`, `odometry_ms`, the seven statistics of `table_iii_m`, and `notes`.
    Raises InputError where a folder holds no whole run.
    """
    inputs = {name: _figures(folder) for name, folder in folders.items()}
    dense = _odometry(folders[DENSE]) if DENSE in folders else None
    for name, folder in folders.items():
        off = None if dense is None or name == DENSE else evaluate(_odometry(folder), dense)["ate"]["aligned"]["rmse"]
        inputs[name]["to_64_m"] = off
    segments = sorted({figures["drift_name"] for figures in inputs.values() if figures["drift_name"]})
    drift = "; ".join([PROTOCOL["drift"], *segments])
    return {"inputs": inputs, "protocol": PROTOCOL | {"drift": drift}}


def _odometry(folder: Path) -> Any:
    """Poses (N, 4, 4) before loops."""
    return read_poses(folder / "odometry_tum.txt")[1]


def _figures(folder: Path) -> dict[str, Any]:
    try:
        report = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        metrics = folder / "metrics.json"
        accuracy = _accuracy(json.loads(metrics.read_text(encoding="utf-8"))["slam"] if metrics.exists() else None)
        with (folder / "timings.csv").open(encoding="utf-8") as file:
            points = [int(row["points"]) for row in csv.DictReader(file)]
        times = report["timings_ms"]
        return accuracy | {
            "path_m": report["path_length_m"],
            "frames": report["counts"]["frames"],
            "failed": report["counts"]["failed"],
            "loops": report["loops"]["accepted"],
            "map_points": report["map_points"],
            "points_per_scan": round(median(points)),
            "front_end_ms": times["front_end"]["median"],
            "odometry_ms": times["odometry"]["median"],
        }
    except (OSError, ValueError, TypeError, KeyError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise InputError(f"{folder}: no whole run to compare ({reason}); run it again") from error


def _accuracy(metrics: Metrics | None) -> dict[str, Any]:
    """The figures against ground truth, from the entry `slam` of metrics.json."""
    if metrics is None:
        names = ("table_iii_m", "ate_m", "rpe_m", "rpe_deg", "drift_percent", "drift_deg_per_100m", "drift_name")
        return {**dict.fromkeys(names), "notes": ["no ground truth: no ATE, RPE or drift"]}
    drift = metrics["drift"]
    return {
        "ate_m": metrics["ate"]["aligned"]["rmse"],
        "table_iii_m": {name: metrics["paper_table_iii"][name] for name in STATISTICS},
        "rpe_m": metrics["rpe"]["frame"]["rmse"],
        "rpe_deg": metrics["rpe"]["frame_rotation"]["rmse"],
        "drift_percent": drift["translation_percent"],
        "drift_deg_per_100m": drift["rotation_deg_per_100m"],
        "drift_name": drift["name"],
        "notes": [*metrics["notes"], *([f"no drift, {drift['reason']}"] if drift["reason"] else [])],
    }
