"""`lidarlift run`: a drive becomes a run folder."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from lidarlift.cli.arguments import EnricherOption, frame_slice
from lidarlift.running import run_into
from slam.config import load_config, preset_names
from slam.data.errors import InputError


class Input(StrEnum):
    SIXTY_FOUR = "64"
    SIXTEEN = "16"
    ENRICHED = "enriched"


def run(
    dataset: Annotated[Path, typer.Argument(help="A KITTI odometry or raw folder, or a folder of scans.")],
    sequence: Annotated[str | None, typer.Option(help="Which sequence or drive, where the folder has several.")] = None,
    input: Annotated[
        Input | None,
        typer.Option(help="64: the scan as recorded; 16: rings dropped; enriched: 16, the rest filled in."),
    ] = None,
    enricher: EnricherOption = None,
    config: Annotated[str | None, typer.Option(help=f"A YAML file or a preset: {', '.join(preset_names())}.")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="One setting: odometry.voxel_size=1.0")] = None,
    frames: Annotated[str, typer.Option(help="A slice of the drive, FROM:TO or FROM:TO:STEP.")] = ":",
    sensor: Annotated[str | None, typer.Option(help="hdl64, vlp16 or a YAML file with the beams.")] = None,
    odometry: Annotated[
        Path | None,
        typer.Option(help="LiDAR poses of another odometry instead, one a scan, KITTI or TUM format."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The run folder. Default: runs/NAME-INPUT.")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Stop at the first damaged file instead of going on.")
    ] = False,
) -> None:
    """Drive through a data set: trajectory, map, and ATE, RPE and drift where there is ground truth.

    Example: `lidarlift run kitti/sequences/04 --frames 0:50 --set odometry.voxel_size=1.25 --out runs/04`
    """
    from eval.tables import format_table
    from slam.data.dataset import open_dataset
    from slam.session import read_report

    data = open_dataset(dataset, sequence, sensor)
    few_rings = data.sensor is not None and data.sensor.ring_count <= 16
    if few_rings and input is Input.SIXTY_FOUR:
        raise InputError(f"{dataset}: its sensor has no 64 rings; leave --input out")
    channels = input.value if input else "16" if few_rings else None
    settings = load_config(config, set_ or (), input=channels, enricher=enricher)
    if enricher and settings.front_end.input != "enriched":
        raise InputError(f"--enricher {enricher}: nothing is filled in here; add --input enriched")
    folder = out or Path("runs") / f"{data.name.lower().replace(' ', '-')}-{settings.front_end.input}"

    metrics = run_into(folder, data, settings, frame_slice(frames), odometry=odometry, strict=strict)
    report = read_report(folder)
    print(_summary(report))
    if metrics:
        closed = ["slam", "odometry"] if report["loops"]["accepted"] else ["odometry"]  # equal without loops
        print(format_table({name: metrics[name] for name in closed}, metrics["protocol"]))
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
    return (
        f"{protocol['dataset']}, input {protocol['input']}, deskew {'on' if protocol['deskew'] else 'off'}, "
        f"vertical correction {protocol['vertical_correction_deg']:.3f} deg, "
        f"registration {odometry['registration']} against the {odometry['target']}\n"
        f"{counts['frames']} frames, {report['path_length_m']:.2f} m; {counts['retried']} registered after a search, "
        f"{counts['failed']} failed; map of {report['map_points']:,} points\n"
        f"{_loops(report['loops'])}\n"
        f"Median: odometry {times['odometry']['median']:.1f} ms a frame; beside it {', '.join(beside)}\n"
    )


def _loops(loops: dict[str, int]) -> str:
    if not loops["candidates"]:
        return f"No place was recognised among {loops['keyframes']} keyframes: no loops, poses are the odometry's"
    found = f"{loops['accepted']} loops closed" if loops["accepted"] else "no loop closed, poses are the odometry's"
    return f"{loops['keyframes']} keyframes, {loops['candidates']} candidates registered, {found}; see loops.csv"
