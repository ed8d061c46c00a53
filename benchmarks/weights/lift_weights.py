"""Weights of Lift for measuring on a drive: weights trained without it, if there are any."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from importlib.resources.abc import Traversable
from pathlib import Path

from enrichment.methods.lift import LiftMethod
from enrichment.methods.onnx_network import WEIGHTS
from enrichment.methods.registry import LIFT
from slam.data.errors import InputError

SEEN = ("0005", "0013")  # the shipped weights were trained on these


def held_out(text: str) -> tuple[str, Path]:
    """--held-out SEQUENCE=FOLDER."""
    drive, equals, folder = text.partition("=")
    if not (drive and equals and folder):
        raise argparse.ArgumentTypeError(f"{text}: write SEQUENCE=FOLDER, as in 0005=weights-without-0005")
    return drive, Path(folder)


def weights_for(drive: str, folders: Mapping[str, Path]) -> tuple[str, Traversable]:
    """Return a description of the weights for a drive, and their folder.

    `folders` are those of trainings without a drive, by the end of its name; the shipped weights are used otherwise.
    """
    for ending, folder in folders.items():
        if drive.endswith(ending):
            return "without this drive", folder
    return "shipped, have seen it" if drive.endswith(SEEN) else "shipped", WEIGHTS


def lift_for(drive: str, folders: Mapping[str, Path]) -> tuple[str, LiftMethod]:
    """Return a description of the weights for a drive, and Lift with them."""
    about, folder = weights_for(drive, folders)
    return about, lift_of(folder)


def lift_of(folder: Traversable = WEIGHTS) -> LiftMethod:
    """Raises InputError where the folder has no weights."""
    lift = LiftMethod(folder)
    if lift.parameters is None:
        raise InputError(f"{folder}: no weights of {LIFT} that could run here")
    return lift
