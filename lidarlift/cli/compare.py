"""`lidarlift compare`: one sequence at 16 channels, enriched and at 64; or finished runs and other trajectories."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import (
    ConfigOption,
    EnricherOption,
    FramesOption,
    SetOption,
    StrictOption,
    frame_slice,
)
from lidarlift.cli.console import Console, command_line
from lidarlift.cli.data_options import DataOptions, with_data_options
from lidarlift.comparing import available_inputs, compare_into, comparison_title, rows_for
from lidarlift.comparing_trajectories import compared, is_of_trajectories
from lidarlift.folders import default_folder
from slam.data.errors import InputError

if TYPE_CHECKING:
    from eval.compare import Comparison


@with_data_options
def compare(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="DATASET | TRAJECTORY TRAJECTORY ...",
            help="A data set, as for `lidarlift run`; or run folders, trajectory files (KITTI, TUM, EuRoC) and topics "
            "of recordings (drive.bag:/odom), each as PATH or LABEL=PATH.",
        ),
    ],
    reading: DataOptions,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    frames: FramesOption = ":",
    reference: Annotated[
        str | None,
        typer.Option(help="Of trajectories: a trajectory or a data set. Default: the runs' ground truth."),
    ] = None,
    calib: Annotated[
        Path | None, typer.Option(help="Of trajectories: KITTI calib.txt, transforms those of camera 0 into the LiDAR.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The folder for the results. Default: runs/NAME-compared.")] = None,
    strict: StrictOption = False,
) -> None:
    """Compare 16 channels, these enriched, and 64 on a data set; or finished runs and trajectories of other systems.

    Example: `lidarlift compare kitti/sequences/04 --frames 0:50 --out runs/04`

    Example: `lidarlift compare runs/mine KISS=kiss_poses.txt GLIM=glim.txt --reference truth_tum.txt`

    A data set is run three times, into a folder each; if the enricher is not ray-segment, ray-segment gets a row as
    well: it needs no training. One PATH is a data set, unless it is a run folder, a trajectory file or
    RECORDING:TOPIC; several are finished runs and trajectories.
    """
    own = {"--enricher": enricher, "--config": config, "--set": set_, "--strict": strict or None}
    if is_of_trajectories(paths, reference):
        given = own | {"--frames": None if frames == ":" else frames} | reading.given()
        for option, value in given.items():
            if value is not None and option not in ("--sequence", "--truth-topic"):
                raise InputError(f"{option} is for a data set; finished runs and trajectories are read as they are")
        _compare_trajectories(paths, reference, reading.sequence, reading.truth_topic, calib, out)
        return
    if calib is not None:
        raise InputError(f"--calib {calib}: is for finished runs and trajectories, and {paths[0]} is a data set")
    data = reading.opened(Path(paths[0]))
    folder = out or default_folder(data, "compared")
    rows, chosen = rows_for(available_inputs(data), enricher, config, set_ or ()), frame_slice(frames)
    comparison = compare_into(folder, data, rows, chosen, Console(), strict=strict, command=command_line())
    print_comparison(comparison, comparison_title(data, rows, chosen), folder, rows)


def _compare_trajectories(
    paths: list[str],
    reference: str | None,
    sequence: str | None,
    truth_topic: str | None,
    calib: Path | None,
    out: Path | None,
) -> None:
    from eval.sources import labelled, source_of
    from eval.tables import format_comparison

    labels = [source.label for source in labelled([source_of(path) for path in paths])]
    folder = out or Path("runs") / f"{'-'.join(re.sub('[^A-Za-z0-9._]+', '-', label) for label in labels[:3])}-compared"
    comparison, title = compared(paths, folder, reference, sequence, truth_topic, calib, command_line())
    print(f"{title}\n\n{format_comparison(comparison)}")
    print_written(folder)


def print_comparison(comparison: Comparison, title: str, folder: Path, rows: Iterable[str]) -> None:
    """Print the tables and the list of files that were written."""
    from eval.tables import format_comparison

    print(f"\n{title}\n")
    print(format_comparison(comparison))
    files = "map.pcd, map.png, trajectory_tum.txt (and _kitti), trajectory.png, loops.csv, metrics.json"
    for row in rows:
        print(f"{folder / row}: {files}")
    print_written(folder)


def print_written(folder: Path) -> None:
    """Print the files of the comparison itself."""
    print(f"{folder / 'compare.json'}, {folder / 'compare.md'}: the tables above")
    print(f"{folder / 'report.html'}: everything in one page, for a browser")
