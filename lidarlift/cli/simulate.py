"""`lidarlift simulate`: a sequence in a synthetic scene, with exact ground truth."""

from __future__ import annotations

import math
import shlex
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lidarlift.cli.arguments import one_of
from lidarlift.cli.console import progress
from lidarlift.cli.data_options import Stamp
from slam.data.atomic import require_writable
from slam.data.sensor_names import SENSORS
from slam.simulation.drive_names import DRIVES


class Format(StrEnum):
    """Folder layout."""

    KITTI = "kitti"
    FOLDER = "folder"
    BAG = "bag"
    ROS2 = "ros2"
    MCAP = "mcap"


class Driver(StrEnum):
    """Driver whose point fields are written."""

    VELODYNE = "velodyne"
    OUSTER = "ouster"
    HESAI = "hesai"
    ROBOSENSE = "robosense"
    LIVOX = "livox"


def simulate(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the simulated data set.")],
    drive: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            callback=one_of(DRIVES),
            help=f"A built-in scene: {', '.join(DRIVES.names())}. Default: loop, which revisits places.",
        ),
    ] = None,
    trajectory: Annotated[
        Path | None, typer.Option(help="Follow the poses of this file instead, in KITTI or TUM format.")
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Number of frames. Default: the whole sequence.")] = None,
    sensor: Annotated[
        str,
        typer.Option(metavar="NAME", callback=one_of(SENSORS), help=f"The LiDAR: {', '.join(SENSORS.names())}."),
    ] = "hdl64",
    rate: Annotated[float, typer.Option(metavar="HZ", help="Rotation rate of the LiDAR, and frame rate.")] = 10.0,
    height: Annotated[
        float | None,
        typer.Option(metavar="M", help="Height of the LiDAR above the ground. Default: 1.73 on a car."),
    ] = None,
    tilt: Annotated[
        float, typer.Option(metavar="DEG", help="Pitch of the LiDAR, positive downwards; the camera stays level.")
    ] = 0.0,
    spacing: Annotated[
        float | None, typer.Option(metavar="M", help="Distance between frames. Default: from --rate and the speed.")
    ] = None,
    distort: Annotated[
        bool, typer.Option("--distort", help="Add motion distortion: the sensor moves during a sweep; `run` deskews.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of scene, traffic and noise.")] = 0,
    with_depth: Annotated[
        bool, typer.Option("--with-depth", help="Write the exact depth of each image and an exact 64-channel scan too.")
    ] = False,
    format: Annotated[
        Format,
        typer.Option(
            help="kitti: layout of KITTI odometry; folder: .pcd scans with ring and time of each point; bag, ros2, "
            "mcap: a recording of ROS 1, of ROS 2 in SQLite or MCAP, with camera, IMU, GNSS and true poses."
        ),
    ] = Format.KITTI,
    driver: Annotated[
        Driver | None,
        typer.Option(
            help="Driver whose fields the points have. Default: none in a folder, the LiDAR's own in a recording."
        ),
    ] = None,
    stamp: Annotated[
        Stamp | None,
        typer.Option(
            help="Instant of a sweep to which its stamp and true pose refer, in a folder or a recording. Default: the "
            "driver's, else the middle."
        ),
    ] = None,
) -> None:
    """Simulate a sequence: scans, images, calibration and true poses. An interrupted simulation is resumed.

    Example: `lidarlift simulate town --drive loop --frames 200`
    """
    if drive and trajectory:
        raise typer.BadParameter("replaces the built-in scene; leave --drive out", param_hint="--trajectory")
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
        stamp=stamp and stamp.value,
        driver=driver and driver.value,
    )
    simulation = Simulation(settings)
    count = min(frames or len(simulation), len(simulation))
    with progress("Simulating", count) as advance:
        simulation.write(folder, count, advance)
    print(f"Written to {folder}: {count} frames of {sensor}, with true poses")
    name = folder.resolve().name
    print(f"Next: {shlex.join(['lidarlift', 'run', str(folder), '--out', f'runs/{name}'])}")
