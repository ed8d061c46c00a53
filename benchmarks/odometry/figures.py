"""Figures of runs: speed, accuracy, distance to the dense trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.odometry.measure import UNCOUNTED, Run
from eval.evaluation import orthonormal
from eval.kitti_metric import kitti_drift
from eval.trajectory import ate, path_length
from slam.data.cloud import Array

Figures = dict[str, Any]


def figures(runs: Sequence[Run], kiss: Sequence[Run], truth: Array | None, dense: Array | None) -> Figures:
    """One system's entry in the JSON file; only `error` where it did not come through.

    truth, dense  (N, 4, 4), truth NaN where unknown, or None
    """
    error = next((run.error for run in runs if run.error), None)
    if error:
        return {"error": error}
    return {
        **_timing(runs, kiss),
        **_accuracy([np.array(run.poses) for run in runs], truth, dense),
        "failed_frames": _most(runs, "failed"),
        "degenerate_frames": _most(runs, "degenerate"),
        "error": None,
    }


def _most(runs: Sequence[Run], status: str) -> int | None:
    """In how many frames a run had that status, at most; None where the system does not say."""
    return max((count for run in runs if (count := run.count(status)) is not None), default=None)


def _timing(runs: Sequence[Run], kiss: Sequence[Run]) -> Figures:
    """Times of the counted scans of all repeats, and the ratio of KISS-ICP's median to this one's."""
    milliseconds = _counted(runs)
    if milliseconds.size == 0:
        return {"median_ms": None, "p95_ms": None, "fps": None, "ratio_to_kiss": None, "ratio_to_kiss_repeats": None}
    ratio = repeats = None
    if not any(run.error for run in kiss):
        kiss_milliseconds = _counted(kiss)
        ratio = float(np.median(kiss_milliseconds) / np.median(milliseconds))
        repeats = (np.median(kiss_milliseconds, axis=1) / np.median(milliseconds, axis=1)).tolist()
    return {
        "median_ms": float(np.median(milliseconds)),
        "p95_ms": float(np.percentile(milliseconds, 95)),
        "fps": float(1000 / milliseconds.mean()),
        "ratio_to_kiss": ratio,
        "ratio_to_kiss_repeats": repeats,
    }


def _counted(runs: Sequence[Run]) -> Array:
    """(repeats, scans) [ms]."""
    return 1000 * np.array([run.seconds[UNCOUNTED:] for run in runs])


def _accuracy(trajectories: Sequence[Array], truth: Array | None, dense: Array | None) -> Figures:
    """Figures of the first repeat; `repeats_differ_m` is the largest distance between positions of the repeats."""
    first = trajectories[0]
    positions = np.array([poses[:, :3, 3] for poses in trajectories])
    result: Figures = {
        "ate_m": None,
        "dense_m": None if dense is None else ate(orthonormal(first), orthonormal(dense)).rmse,
        "path_length_m": path_length(first),
        "drift": None,
        "repeats_differ_m": float(np.linalg.norm(positions - positions[0], axis=-1).max()),
    }
    if truth is None:
        return result
    known = np.isfinite(truth[:, 0, 0])
    if known.sum() > 1:
        estimate, reference = orthonormal(first[known]), orthonormal(truth[known])
        result["ate_m"] = ate(estimate, reference).rmse
        result["drift"] = kitti_drift(estimate, reference).as_dict()
    return result
