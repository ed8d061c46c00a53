"""`lidarlift run`: a drive becomes a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lidarlift.cli.arguments import (
    ColumnsOption,
    ConfigOption,
    DatasetArgument,
    EnricherOption,
    FramesOption,
    InputOption,
    PointTimeOption,
    SensorOption,
    SequenceOption,
    SetOption,
    StampOption,
    StrictOption,
    frame_slice,
)
from lidarlift.cli.console import Console
from lidarlift.front_ends import settings_for
from lidarlift.running import run_into


def run(
    dataset: DatasetArgument,
    sequence: SequenceOption = None,
    input: InputOption = None,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    frames: FramesOption = ":",
    sensor: SensorOption = None,
    stamp: StampOption = None,
    point_time: PointTimeOption = None,
    columns: ColumnsOption = None,
    odometry: Annotated[
        Path | None,
        typer.Option(help="LiDAR poses of another odometry instead, one a scan, KITTI or TUM format."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The run folder. Default: runs/NAME-INPUT.")] = None,
    strict: StrictOption = False,
) -> None:
    """Drive through a data set: trajectory, map, and ATE, RPE and drift where there is ground truth.

    Example: `lidarlift run kitti/sequences/04 --frames 0:50 --set odometry.cell_sizes=[1.2,0.8] --out runs/04`
    """
    from eval.tables import format_metrics
    from slam.data.dataset import open_dataset
    from slam.session import read_report

    said = {"stamp": stamp and stamp.value, "point_time": point_time, "columns": columns}
    data = open_dataset(dataset, sequence, sensor, **said)
    chosen = settings_for(data.sensor, input and input.value, enricher, config, set_ or ())
    folder = out or Path("runs") / f"{data.name.lower().replace(' ', '-')}-{chosen.front_end.input}"
    _, metrics = run_into(folder, data, chosen, frame_slice(frames), Console(), odometry=odometry, strict=strict)
    report = read_report(folder)
    print(_summary(report))
    if metrics:
        closed = {"slam": metrics.slam} if report["loops"]["accepted"] else {}  # equal without loops
        print(format_metrics({**closed, "odometry": metrics.odometry}))
    else:
        print("No ground truth: no ATE, RPE or drift.")
    print(f"Written to {folder}: {', '.join(sorted(file.name for file in folder.iterdir()))}")


def _summary(report: dict[str, Any]) -> str:
    """What was run, and how it went, in a few lines; `report` is run.json."""
    protocol, counts, times = report["protocol"], report["counts"], report["timings_ms"]
    odometry = protocol["config"]["odometry"]
    of = {"map": "frame", "loops": "keyframe", "back_end": "keyframe"}
    known = {name: unit for name, unit in of.items() if name in times}
    beside = [f"{name.replace('_', ' ')} {times[name]['median']:.1f} ms a {unit}" for name, unit in known.items()]
    notes = "".join(f"{note}\n" for note in report["notes"])
    return (
        f"{protocol['dataset']}, input {protocol['input']}, deskew {'on' if protocol['deskew'] else 'off'}, "
        f"vertical correction {protocol['vertical_correction_deg']:.3f} deg, "
        f"registration {odometry['registration']} against the {odometry['target']}{_cells(protocol['sizes_m'])}\n"
        f"{counts['frames']} frames, {report['path_length_m']:.2f} m; {counts['retried']} registered after a search, "
        f"{counts['failed']} failed; map of {report['map_points']:,} points\n"
        f"{protocol['point_times']}\n"
        f"{notes}{_loops(report['loops'])}\n"
        f"Median: odometry {times['odometry']['median']:.1f} ms a frame; beside it {', '.join(beside)}\n"
    )


def _cells(sizes: dict[str, Any] | None) -> str:
    """The cells that the first scan, or a setting, has chosen."""
    return f", cells of {' and '.join(f'{size:.2g}' for size in sizes['cell_sizes'])} m" if sizes else ""


def _loops(loops: dict[str, int]) -> str:
    if not loops["candidates"]:
        return f"No place was recognised among {loops['keyframes']} keyframes: no loops, poses are the odometry's"
    found = f"{loops['accepted']} loops closed" if loops["accepted"] else "no loop closed, poses are the odometry's"
    return f"{loops['keyframes']} keyframes, {loops['candidates']} candidates registered, {found}; see loops.csv"
