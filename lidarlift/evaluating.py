"""Evaluation of a run or any trajectory against ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eval.metrics import Metrics


def evaluate(estimate: str | Path, reference: str | Path | None = None, calib: str | Path | None = None) -> Metrics:
    """Compute ATE, RPE and KITTI's drift of a trajectory.

    Args:
        estimate: A trajectory file in KITTI or TUM format; or, without `reference`, a run folder with ground truth,
            whose metrics.json is rewritten.
        reference: The ground-truth file in KITTI or TUM format.
        calib: KITTI's calib.txt, which transforms a camera-0 reference into the LiDAR frame.

    Returns:
        The figures, each with its protocol; for a run folder those of the trajectory after loop closure.

    Raises:
        InputError: A file cannot be read, the two trajectories cannot be matched, or the run folder has no ground
            truth.
        ValueError: `calib` is given without a reference.
    """
    from eval.evaluation import evaluate_files, evaluate_run
    from slam.data.errors import InputError

    estimate = Path(estimate)
    if reference is not None:
        return evaluate_files(estimate, Path(reference), None if calib is None else Path(calib))
    if calib is not None:
        raise ValueError("calib transforms a reference into the LiDAR frame; give a reference or leave calib out")
    metrics = evaluate_run(estimate) if estimate.is_dir() else None
    if metrics is None:
        raise InputError(f"{estimate}: no ground truth found; give a reference file")
    return metrics.slam
