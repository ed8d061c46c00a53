"""`lidarlift evaluate`: a trajectory file against a reference."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lidarlift.cli.data_options import DataOptions, with_data_options


@with_data_options
def evaluate(
    estimate: Annotated[Path, typer.Argument(help="Trajectory, KITTI or TUM format.")],
    reference: Annotated[
        str, typer.Argument(help="Ground truth, KITTI or TUM format; or a data set that has it; or RECORDING:TOPIC.")
    ],
    reading: DataOptions,
    calib: Annotated[
        Path | None, typer.Option(help="KITTI calib.txt: transforms a camera-0 reference into the LiDAR frame.")
    ] = None,
) -> None:
    """Evaluate a trajectory against ground truth: ATE, RPE and KITTI's drift, each with its protocol.

    Example: `lidarlift evaluate runs/04/trajectory_kitti.txt poses/04.txt --calib sequences/04/calib.txt`
    """
    from eval.tables import format_metrics
    from lidarlift.evaluating import evaluate as evaluated

    options = reading.said()
    metrics = evaluated(estimate, reference, calib, sequence=reading.sequence, sensor=reading.sensor, **options)
    print(format_metrics({estimate.name: metrics}))
