"""Trainings by the command line, each in a process of its own; an interrupted one is resumed."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from enrichment.training.checkpoint import CHECKPOINT

TOWNS = (("loop", 11), ("straight", 12), ("jam", 13))  # drive and seed: another town each
TOWN_FRAMES = 40


def learn(model: str, data: Iterable[Path], out: Path, *options: object, start: Sequence[object] = ()) -> None:
    """`lidarlift train`: an interrupted training is resumed, a new one gets the options of `start` too."""
    resumed = (out / CHECKPOINT).exists()
    command = (model,) if model == "lift" else ("depth", model)
    lidarlift("train", *command, *data, "--out", out, *options, *(("--resume",) if resumed else start))


def town(out: Path, drive: str, seed: int) -> Path:
    """The folder of a simulated drive to train on, in `out`."""
    folder = out / "towns" / drive
    lidarlift("simulate", folder, "--drive", drive, "--seed", seed, "--frames", TOWN_FRAMES, "--with-depth")
    return folder


def lidarlift(*words: object) -> None:
    """The command, in a process of its own; its failure ends this one."""
    arguments = [str(word) for word in words]
    print(f"lidarlift {shlex.join(arguments)}", flush=True)
    done = subprocess.run([sys.executable, "-m", "lidarlift", *arguments], check=False)
    if done.returncode:
        sys.exit(done.returncode)
