"""Evaluation of a run or any trajectory against ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

if TYPE_CHECKING:
    from eval.metrics import Metrics
    from slam.data.dataset import DatasetOptions


def evaluate(
    estimate: str | Path,
    reference: str | Path | None = None,
    calib: str | Path | None = None,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    **options: Unpack[DatasetOptions],
) -> Metrics:
    """Compute ATE, RPE and KITTI's drift of a trajectory.

    Args:
        estimate: A trajectory file in KITTI or TUM format; or, without `reference`, a run folder with ground truth,
            whose metrics.json is rewritten.
        reference: The ground-truth file in KITTI or TUM format; a recording or another data set with ground truth; or
            RECORDING:TOPIC.
        calib: KITTI's calib.txt, which transforms a camera-0 reference into the LiDAR frame.
        sequence: Name of the sequence, if the reference is a data set with several.
        sensor: As in `open_dataset`, if the reference is a data set.
        **options: Likewise.

    Returns:
        The figures, each with its protocol; for a run folder those of the trajectory after loop closure.

    Raises:
        InputError: A file cannot be read, the two trajectories cannot be matched, or the run folder has no ground
            truth.
        ValueError: `calib` is given without a reference.
    """
    import numpy as np

    from eval.evaluation import evaluate_run, evaluate_trajectory
    from eval.sources import read_reference
    from slam.data.errors import InputError
    from slam.data.pose_files import Trajectory

    estimate = Path(estimate)
    if reference is not None:
        named = read_reference(str(reference), sequence, sensor, **options)
        track = named.row.track
        theirs = named.file or Trajectory(track.poses, np.arange(len(track.poses)), track.stamps)
        return evaluate_trajectory(estimate, theirs, Path(reference), None if calib is None else Path(calib))
    if calib is not None:
        raise ValueError("calib transforms a reference into the LiDAR frame; give a reference or leave calib out")
    metrics = evaluate_run(estimate) if estimate.is_dir() else None
    if metrics is None:
        raise InputError(f"{estimate}: no ground truth found; give a reference file")
    return metrics.slam
