"""`lidarlift simulate`: a drive or a walk through a scene that is made up, its truth known."""

from __future__ import annotations

import math
import shlex
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lidarlift.cli.arguments import Stamp, one_of
from lidarlift.cli.console import progress
from slam.data.atomic import require_writable
from slam.data.sensor_names import SIMULATED
from slam.simulation.drive_names import DRIVES


class Format(StrEnum):
    KITTI = "kitti"
    FOLDER = "folder"


def simulate(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder to write.")],
    drive: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            callback=one_of(DRIVES),
            help=f"A built-in drive: {', '.join(DRIVES.names())}. Default: loop, which comes by the same places twice.",
        ),
    ] = None,
    trajectory: Annotated[
        Path | None, typer.Option(help="Drive along the poses of this file instead, KITTI or TUM format.")
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Only so many, from the start of the drive.")] = None,
    sensor: Annotated[
        str,
        typer.Option(metavar="NAME", callback=one_of(SIMULATED), help=f"The LiDAR: {', '.join(SIMULATED.names())}."),
    ] = "hdl64",
    rate: Annotated[float, typer.Option(metavar="HZ", help="Turns of the LiDAR a second, and frames.")] = 10.0,
    height: Annotated[
        float | None,
        typer.Option(metavar="M", help="Of the LiDAR above the ground. Default: 1.73 on a car."),
    ] = None,
    tilt: Annotated[
        float, typer.Option(metavar="DEG", help="Of the LiDAR, positive with its nose down; the camera stays level.")
    ] = 0.0,
    spacing: Annotated[float | None, typer.Option(help="Metres between frames. Default: ten frames a second.")] = None,
    distort: Annotated[
        bool, typer.Option("--distort", help="The car moves during a sweep, as a real one does; `run` deskews.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of town, traffic and noise: the same seed, the same files.")] = 0,
    with_depth: Annotated[
        bool, typer.Option("--with-depth", help="Also the exact depth of each image and the exact 64-channel scan.")
    ] = False,
    format: Annotated[
        Format,
        typer.Option(help="kitti: KITTI odometry's; folder: .pcd scans, their points with ring and time."),
    ] = Format.KITTI,
    stamp: Annotated[
        Stamp, typer.Option(help="The instant of a sweep that its stamp and true pose are of, in a folder.")
    ] = Stamp.MIDDLE,
) -> None:
    """Simulate a drive or a walk: scans, images, calibration and the true poses. An interrupted one is resumed.

    Example: `lidarlift simulate town --drive loop --frames 200`
    """
    if drive and trajectory:
        raise typer.BadParameter("is a drive of its own; leave --drive out", param_hint="--trajectory")
    from slam.simulation.simulation import Simulation, SimulationConfig

    require_writable(folder)
    settings = SimulationConfig(
        drive=drive or "loop",
        trajectory=trajectory,
        spacing=spacing,
        sensor=sensor,
        distort=distort,
        seed=seed,
        depth=with_depth,
        rate=rate,
        height=height,
        tilt=math.radians(tilt),
        format=format.value,
        stamp=stamp.value,
    )
    simulation = Simulation(settings)
    count = min(frames or len(simulation), len(simulation))
    with progress("Simulating", count) as advance:
        simulation.write(folder, count, advance)
    print(f"Written to {folder}: {count} frames of {sensor}, with true poses")
    name = folder.resolve().name
    print(f"Next: {shlex.join(['lidarlift', 'run', str(folder), '--out', f'runs/{name}'])}")
