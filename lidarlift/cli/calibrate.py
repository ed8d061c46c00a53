"""`lidarlift calibrate`: extrinsics of a camera to the LiDAR."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lidarlift.cli.arguments import DatasetArgument, FramesOption, frame_slice
from lidarlift.cli.console import Console
from lidarlift.cli.data_options import DataOptions, with_data_options


@with_data_options
def calibrate(
    dataset: DatasetArgument,
    reading: DataOptions,
    camera: Annotated[
        str | None, typer.Option(help="Name of the camera in calib.yaml. Default: the one that looks ahead.")
    ] = None,
    guess: Annotated[
        Path | None,
        typer.Option(help="A calib.yaml within 5 deg and 20 cm. Default: the calibration of the data set."),
    ] = None,
    delay: Annotated[
        float | None,
        typer.Option(metavar="MS", help="Milliseconds of the images after the scans' stamps. Default: estimated."),
    ] = None,
    frames: FramesOption = ":",
    out: Annotated[Path, typer.Option(help="The file to write; it must not exist yet.")] = Path("calib.yaml"),
) -> None:
    """Estimate a camera's extrinsics from a sequence, without targets: edges of the LiDAR against edges of the images.

    The guess may be off by 5 deg and 20 cm. Values that the sequence does not determine stay those of the guess, and
    are named. Beside the file, a picture shows the points over an image before and after.

    Example: `lidarlift calibrate my_drive --guess measured.yaml --out my_drive/calib.yaml`
    """
    from lidarlift.calibrating import PICTURE, comments
    from lidarlift.calibrating import calibrate as estimate

    result = estimate(
        reading.opened(dataset),
        camera=camera,
        guess=guess,
        delay=None if delay is None else delay / 1000,
        frames=frame_slice(frames),
        out=out,
        reporter=Console(),
    )
    print("\n".join(comments(result)))
    print(f"Written to {out}, picture {out.with_name(PICTURE.format(stem=out.stem))}")
