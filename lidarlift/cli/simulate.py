"""`lidarlift simulate`: a drive through a town that is made up, its truth known."""

from __future__ import annotations

import shlex
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lidarlift.cli.console import progress
from slam.data.atomic import require_writable


class Drive(StrEnum):
    LOOP = "loop"
    STRAIGHT = "straight"
    TUNNEL = "tunnel"
    JAM = "jam"
    BUILDING = "building"


class Sensor(StrEnum):
    HDL64 = "hdl64"
    VLP16 = "vlp16"


def simulate(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder to write, as KITTI odometry has it.")],
    drive: Annotated[
        Drive | None, typer.Option(help="A built-in drive. Default: loop, which comes by the same places twice.")
    ] = None,
    trajectory: Annotated[
        Path | None, typer.Option(help="Drive along the poses of this file instead, KITTI or TUM format.")
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Only so many, from the start of the drive.")] = None,
    sensor: Annotated[Sensor, typer.Option(help="The LiDAR: 64 or 16 channels.")] = Sensor.HDL64,
    spacing: Annotated[float | None, typer.Option(help="Metres between frames. Default: ten frames a second.")] = None,
    distort: Annotated[
        bool, typer.Option("--distort", help="The car moves during a sweep, as a real one does; `run` deskews.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of town, traffic and noise: the same seed, the same files.")] = 0,
    with_depth: Annotated[
        bool, typer.Option("--with-depth", help="Also the exact depth of each image and the exact 64-channel scan.")
    ] = False,
) -> None:
    """Simulate a drive through a town: scans, images, calibration and the true poses. An interrupted one is resumed.

    Example: `lidarlift simulate town --drive loop --frames 200`
    """
    if drive and trajectory:
        raise typer.BadParameter("is a drive of its own; leave --drive out", param_hint="--trajectory")
    from slam.simulation.simulation import Simulation, SimulationConfig

    require_writable(folder)
    settings = SimulationConfig(
        drive=drive.value if drive else "loop",
        trajectory=trajectory,
        spacing=spacing,
        sensor=sensor.value,
        distort=distort,
        seed=seed,
        depth=with_depth,
    )
    simulation = Simulation(settings)
    count = min(frames or len(simulation), len(simulation))
    with progress("Simulating", count) as advance:
        simulation.write(folder, count, advance)
    print(f"Written to {folder}: {count} frames of {sensor.value}, with true poses")
    name = folder.resolve().name
    print(f"Next: {shlex.join(['lidarlift', 'run', str(folder), '--out', f'runs/{name}'])}")
