"""Arguments shared by several commands, and their validation before any work begins."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from enrichment.methods.registry import METHODS
from slam.data.errors import InputError
from slam.data.registry import Registry
from slam.preset_files import preset_names

DatasetArgument = Annotated[
    Path,
    typer.Argument(
        help="A KITTI odometry or raw folder, a recording (.bag, .db3, .mcap), a packet capture (.pcap), or a folder "
        "of scans."
    ),
]
FramesOption = Annotated[str, typer.Option(help="Slice of the sequence, FROM:TO or FROM:TO:STEP.")]
ConfigOption = Annotated[str | None, typer.Option(help=f"YAML file or preset: {', '.join(preset_names())}.")]
SetOption = Annotated[list[str] | None, typer.Option("--set", help="One setting: odometry.voxel_size=1.0")]
StrictOption = Annotated[bool, typer.Option("--strict", help="Stop with an error at the first problem of the data.")]


def _known_input(text: str | None) -> str | None:
    """Check --input."""
    if text is None:
        return None
    from slam.settings import FrontEndSettings

    try:
        return FrontEndSettings(input=text).input
    except ValueError as error:
        raise typer.BadParameter(f"'{text}' is not full, enriched or a number of rings, as in 16") from error


InputOption = Annotated[
    str | None,
    typer.Option(
        metavar="full|N|enriched",
        callback=_known_input,
        help="full: scans as recorded (64 for 64 rings); 16 or another number: so many of the rings; enriched: virtual "
        "beams between 16 of 64 rings, or between all rings of a sparser LiDAR.",
    ),
]
EnricherOption = Annotated[
    str | None,
    typer.Option(
        "--enricher",
        metavar="NAME",
        help=f"Enrichment method: {', '.join(METHODS.names())}. Default: ray-segment, fast and without training; lift "
        "is our network.",
    ),
]


def frame_slice(text: str) -> slice:
    """Return --frames FROM:TO or FROM:TO:STEP as a slice.

    Raises:
        InputError: The text is not a slice, or the step is below 1.
    """
    try:
        parts = [int(part) if part else None for part in text.split(":")]
        if len(parts) not in (2, 3) or (len(parts) == 3 and (parts[2] is not None and parts[2] < 1)):
            raise ValueError
    except ValueError as error:
        raise InputError(f"--frames {text}: not a slice; use FROM:TO or FROM:TO:STEP, as in 0:50 or ::2") from error
    return slice(*parts)


def one_of(registry: Registry[Any]) -> Callable[[str | None], str | None]:
    """Return the callback of an option that takes one of a registry's names."""

    def checked(name: str | None) -> str | None:
        if name is not None and name not in registry.names():
            raise typer.BadParameter(f"'{name}' is not one of {', '.join(registry.names())}")
        return name

    return checked
