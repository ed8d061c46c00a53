"""`lidarlift evaluate`: a trajectory file against a reference."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def evaluate(
    estimate: Annotated[Path, typer.Argument(help="Trajectory, KITTI or TUM format.")],
    reference: Annotated[Path, typer.Argument(help="Ground truth, KITTI or TUM format.")],
    calib: Annotated[
        Path | None, typer.Option(help="KITTI calib.txt: transforms a camera-0 reference into the LiDAR frame.")
    ] = None,
) -> None:
    """Evaluate a trajectory against ground truth: ATE, RPE and KITTI's drift, each with its protocol.

    Example: `lidarlift evaluate runs/04/trajectory_kitti.txt poses/04.txt --calib sequences/04/calib.txt`
    """
    from eval.evaluation import evaluate_files
    from eval.tables import format_metrics

    print(format_metrics({estimate.name: evaluate_files(estimate, reference, calib)}))
