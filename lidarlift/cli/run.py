"""`lidarlift run`: SLAM over a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lidarlift.cli.arguments import (
    ConfigOption,
    DatasetArgument,
    EnricherOption,
    FramesOption,
    InputOption,
    SetOption,
    StrictOption,
    frame_slice,
)
from lidarlift.cli.console import Console, command_line
from lidarlift.cli.data_options import DataOptions, with_data_options
from lidarlift.folders import default_folder
from lidarlift.front_ends import settings_for
from lidarlift.running import run_into
from lidarlift.watching.choice import Views


@with_data_options
def run(
    dataset: DatasetArgument,
    reading: DataOptions,
    input: InputOption = None,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    frames: FramesOption = ":",
    odometry: Annotated[
        Path | None,
        typer.Option(help="File with LiDAR poses of another odometry, one per scan, KITTI or TUM format."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The run folder. Default: runs/NAME-INPUT.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the run in the folder that was stopped or killed.")
    ] = False,
    strict: StrictOption = False,
    live: Annotated[bool, typer.Option("--live", help="Show the run in rerun (extra `view`).")] = False,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Write the run for rerun, to be opened anywhere.")
    ] = None,
    serve: Annotated[
        str | None,
        typer.Option(
            metavar="[HOST:]PORT",
            help="Show the progress in a browser, http://127.0.0.1:PORT: read-only, and only here without HOST.",
        ),
    ] = None,
) -> None:
    """Run SLAM over a data set: trajectory, map, and, with ground truth, ATE, RPE and drift.

    Example: `lidarlift run kitti/sequences/04 --frames 0:50 --set odometry.cell_sizes=[1.2,0.8] --out runs/04`
    """
    from eval.tables import format_metrics
    from slam.data.dataset import ring_count
    from slam.session import read_report

    data = reading.opened(dataset)
    chosen = settings_for(ring_count(data), input, enricher, config, set_ or ())
    folder = out or default_folder(data, chosen.front_end.input)
    views = Views(live, record, serve)
    about: Any = {"odometry": odometry, "strict": strict, "views": views, "command": command_line(), "resume": resume}
    _, metrics = run_into(folder, data, chosen, frame_slice(frames), Console(), **about)
    report = read_report(folder)
    print(_summary(report))
    if metrics:
        closed = {"slam": metrics.slam} if report["loops"]["accepted"] else {}  # identical without loops
        print(format_metrics({**closed, "odometry": metrics.odometry}))
        if metrics.nees:
            print(f"NEES of the poses: {metrics.nees.pose:.2f} (1 where trajectory_covariance.csv is consistent)")
    else:
        print("No ground truth, so no ATE, RPE or drift.")
    print(f"Written to {folder}: {', '.join(sorted(file.name for file in folder.iterdir()))}")


def _summary(report: dict[str, Any]) -> str:
    """Settings and results in a few lines; `report` is the content of run.json."""
    protocol, counts, times = report["protocol"], report["counts"], report["timings_ms"]
    odometry = protocol["config"]["odometry"]
    units = {"map": "frame", "loops": "keyframe", "back_end": "keyframe"}
    medians = {stage: times[stage]["median"] for stage in units if stage in times}
    parallel = [f"{stage.replace('_', ' ')} {ms:.1f} ms per {units[stage]}" for stage, ms in medians.items()]
    notes = "".join(f"{note}\n" for note in report["notes"])
    return (
        f"{protocol['dataset']}, input {protocol['input']}, deskew {'on' if protocol['deskew'] else 'off'}, "
        f"vertical correction {protocol['vertical_correction_deg']:.3f} deg, "
        f"registration {odometry['registration']} against the {odometry['target']}{_cells(protocol['sizes_m'])}\n"
        f"{counts['frames']} frames, {report['path_length_m']:.2f} m; {counts['retried']} retried, "
        f"{counts['failed']} failed; map of {report['map_points']:,} points\n"
        f"{_topics(protocol['topics'])}{protocol['point_times']}\n"
        f"{notes}{_loops(report['loops'])}\n"
        f"Median: odometry {times['odometry']['median']:.1f} ms per frame; in parallel {', '.join(parallel)}\n"
    )


def _topics(used: dict[str, str]) -> str:
    """The topics of a recording."""
    return f"topics: {', '.join(f'{use} {topic}' for use, topic in used.items())}\n" if used else ""


def _cells(sizes: dict[str, Any] | None) -> str:
    """The sizes of the map's cells, from the first scan or a setting."""
    return f", cells of {' and '.join(f'{size:.2g}' for size in sizes['cell_sizes'])} m" if sizes else ""


def _loops(loops: dict[str, int]) -> str:
    """Numbers of keyframes, candidates and loops."""
    if not loops["candidates"]:
        return f"{loops['keyframes']} keyframes, no loop candidates, poses of the odometry"
    found = f"{loops['accepted']} loops closed" if loops["accepted"] else "no loops closed, poses of the odometry"
    return f"{loops['keyframes']} keyframes, {loops['candidates']} candidates registered, {found}; see loops.csv"
