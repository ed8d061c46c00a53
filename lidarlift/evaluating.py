"""Evaluation of a run or any trajectory against ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

if TYPE_CHECKING:
    from eval.metrics import Metrics
    from slam.data.dataset import DatasetOptions
    from slam.data.pose_files import Trajectory


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
        reference: The ground-truth file in KITTI or TUM format; or a recording or another data set with ground truth.
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
    from eval.evaluation import evaluate_run, evaluate_trajectory
    from slam.data.errors import InputError

    estimate = Path(estimate)
    if reference is not None:
        reference = Path(reference)
        theirs = _reference(reference, sequence, sensor, options)
        return evaluate_trajectory(estimate, theirs, reference, None if calib is None else Path(calib))
    if calib is not None:
        raise ValueError("calib transforms a reference into the LiDAR frame; give a reference or leave calib out")
    metrics = evaluate_run(estimate) if estimate.is_dir() else None
    if metrics is None:
        raise InputError(f"{estimate}: no ground truth found; give a reference file")
    return metrics.slam


def _reference(path: Path, sequence: str | None, sensor: str | Path | None, options: DatasetOptions) -> Trajectory:
    """The poses of a trajectory file, or the known ground truth of a data set."""
    import numpy as np

    from slam.data.dataset import open_dataset
    from slam.data.errors import InputError
    from slam.data.pose_files import Trajectory, read_whole_trajectory
    from slam.data.recordings.recording import CONTAINERS

    if not path.is_dir() and path.suffix.lower() not in CONTAINERS:
        given = [name for name, value in {"sequence": sequence, "sensor": sensor, **options}.items() if value]
        if given:
            raise InputError(f"{path}: --{given[0].replace('_', '-')} is for data sets; leave it out")
        return read_whole_trajectory(path)
    data = open_dataset(path, sequence, sensor, **options)
    if data.ground_truth is None:
        why = [problem.message for problem in data.problems if "truth" in problem.kind]
        raise InputError(why[0] if why else f"{path}: has no ground truth; name a file with the true poses")
    known = np.flatnonzero(np.isfinite(data.ground_truth).all(axis=(1, 2)))
    return Trajectory(data.ground_truth[known], known, data.stamps[known])
