"""What users type, checked before any work begins."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from enrichment.methods.registry import METHODS
from slam.data.errors import InputError

EnricherOption = Annotated[
    str | None,
    typer.Option(
        "--enricher",
        metavar="NAME",
        help=f"What fills in: {', '.join(METHODS.names())}. Default: lift, our network; ray-segment learns nothing and "
        "is faster.",
    ),
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


def require_writable(folder: Path) -> None:
    """Raise InputError where `folder` is none or cannot be made; nothing is made yet."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise InputError(f"{folder}: {existing} is no folder that can be written to; choose another")
