"""The arguments that several commands share, and what users type checked before any work begins."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from enrichment.methods.registry import METHODS
from slam.config import preset_names
from slam.data.errors import InputError
from slam.data.registry import Registry
from slam.data.sensor_names import SENSORS


class Input(StrEnum):
    SIXTY_FOUR = "64"
    SIXTEEN = "16"
    ENRICHED = "enriched"


class Stamp(StrEnum):
    START = "start"
    MIDDLE = "middle"
    END = "end"


DatasetArgument = Annotated[Path, typer.Argument(help="A KITTI odometry or raw folder, or a folder of scans.")]
SequenceOption = Annotated[str | None, typer.Option(help="Which sequence or drive, where the folder has several.")]
FramesOption = Annotated[str, typer.Option(help="A slice of the drive, FROM:TO or FROM:TO:STEP.")]
SensorOption = Annotated[str | None, typer.Option(help=f"{', '.join(SENSORS.names())} or a YAML file with the beams.")]
ColumnsOption = Annotated[
    str | None,
    typer.Option(help="What the numbers of .bin and .npy scans are, if not x,y,z,intensity: x,y,z,intensity,ring,t:u4"),
]
ConfigOption = Annotated[str | None, typer.Option(help=f"A YAML file or a preset: {', '.join(preset_names())}.")]
SetOption = Annotated[list[str] | None, typer.Option("--set", help="One setting: odometry.voxel_size=1.0")]
StrictOption = Annotated[bool, typer.Option("--strict", help="Stop at the first damage in the data.")]
InputOption = Annotated[
    Input | None, typer.Option(help="64: the scan as recorded; 16: rings dropped; enriched: 16, the rest filled in.")
]
EnricherOption = Annotated[
    str | None,
    typer.Option(
        "--enricher",
        metavar="NAME",
        help=f"What fills in: {', '.join(METHODS.names())}. Default: lift, our network; ray-segment learns nothing and "
        "is faster.",
    ),
]

StampOption = Annotated[
    Stamp | None,
    typer.Option(
        help="The instant of a sweep that the stamps, and so the poses, belong to. Default: as points' times."
    ),
]
PointTimeOption = Annotated[
    str | None,
    typer.Option(metavar="FIELD[:UNIT]", help="The field with the points' times: t:ns. Default: found by its values."),
]


def frame_slice(text: str) -> slice:
    """--frames FROM:TO or FROM:TO:STEP as a slice. Raises InputError on anything else."""
    try:
        parts = [int(part) if part else None for part in text.split(":")]
        if len(parts) not in (2, 3) or (len(parts) == 3 and (parts[2] is not None and parts[2] < 1)):
            raise ValueError
    except ValueError as error:
        raise InputError(f"--frames {text}: write FROM:TO or FROM:TO:STEP, as in 0:50 or ::2") from error
    return slice(*parts)


def one_of(registry: Registry[Any]) -> Callable[[str | None], str | None]:
    """The callback of an option that takes one of a registry's names."""

    def checked(name: str | None) -> str | None:
        if name is not None and name not in registry.names():
            raise typer.BadParameter(f"'{name}' is not one of {', '.join(registry.names())}")
        return name

    return checked
