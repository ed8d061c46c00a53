"""`lidarlift view`: a finished run in the viewer rerun."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lidarlift.cli.arguments import frame_slice
from lidarlift.cli.console import Console
from lidarlift.cli.data_options import DataOptions, with_data_options


@with_data_options
def view(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="A folder written by `lidarlift run`.")],
    reading: DataOptions,
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE.rrd", help="Write a file in place of opening a window; rerun FILE.rrd opens it."),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(help="Frames of the run that are shown with their scans, FROM:TO:STEP. Default: at most 300."),
    ] = None,
) -> None:
    """Show a finished run in rerun: scans, enriched points by sigma, map, trajectory, loops, images.

    Example: `lidarlift view runs/04`

    Needs the extra `view`. The scans are read from the data set and enriched again; without the data set, map,
    trajectory and loops are shown. Options by which the run read it, such as `--columns`, are given again.
    """
    from lidarlift.watching.finished import log_finished
    from lidarlift.watching.rerun_log import RerunLog
    from slam.session import read_report

    title = f"{folder}: {read_report(folder)['protocol']['dataset']}"  # before a window opens
    chosen = None if frames is None else frame_slice(frames)
    options = reading.said()
    log = RerunLog(title, show=record is None, file=record)
    log_finished(folder, log, chosen, Console(), reading.sequence, reading.sensor, **options)
    if record is not None:
        print(f"Written to {record}; to open it: rerun {record}")
