"""A run, or any trajectory, against ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eval.metrics import Metrics


def evaluate(estimate: str | Path, reference: str | Path | None = None, calib: str | Path | None = None) -> Metrics:
    """ATE, RPE and KITTI's drift of a trajectory.

    Args:
        estimate: A trajectory file, KITTI or TUM format; or, without `reference`, a run folder with ground truth, whose
            metrics.json is written again.
        reference: The ground truth's file, KITTI or TUM format.
        calib: KITTI's calib.txt, which brings a camera-0 reference into the LiDAR's frame.

    Returns:
        The figures, each with its protocol; of a run folder those of the trajectory with loops closed.

    Raises:
        InputError: A file cannot be read, the two cannot be paired, or the run folder has no ground truth.
        ValueError: `calib` is given without a reference that it could transform.
    """
    from eval.evaluation import evaluate_files, evaluate_run
    from slam.data.errors import InputError

    estimate = Path(estimate)
    if reference is not None:
        return evaluate_files(estimate, Path(reference), None if calib is None else Path(calib))
    if calib is not None:
        raise ValueError("calib brings a reference into the LiDAR's frame; give the reference, or leave calib out")
    metrics = evaluate_run(estimate) if estimate.is_dir() else None
    if metrics is None:
        raise InputError(f"{estimate}: no ground truth in it; name the file of a reference")
    return metrics.slam
