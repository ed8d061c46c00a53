"""`lidarlift demo`: 16 channels, enriched and 64 compared on a simulated drive; no data needed."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Annotated

import typer

from lidarlift.cli.compare import print_comparison
from lidarlift.cli.console import Console, messages, progress
from lidarlift.comparing import INPUTS, compare_into, rows_for, title_of
from slam.data.atomic import require_writable
from slam.data.errors import InputError

QUICK, NAME = 100, "Simulated loop"  # frames of the drive


def demo(
    out: Annotated[Path, typer.Option(help="The folder for the runs and their comparison.")] = Path("runs/demo"),
    quick: Annotated[bool, typer.Option("--quick", help=f"Only the first {QUICK} frames: a minute or two.")] = False,
) -> None:
    """See what it does, without any data: simulate a drive, run it at 16 channels, enriched and at 64, and compare.

    Example: `lidarlift demo --quick`
    """
    from slam.data.dataset import open_dataset

    rows = rows_for(INPUTS)
    for row in rows:
        require_writable(out / row)
    town, count = _simulated(QUICK if quick else None)
    messages.print(
        "LiDAR SLAM on these scans: with 16 of the 64 rings, as a cheap LiDAR has them; with the others filled in; "
        "and with all as they were measured."
    )
    data = open_dataset(town)
    comparison = compare_into(out, data, rows, slice(count), Console(), name=NAME)
    print_comparison(comparison, title_of(data, rows, slice(count), NAME), out, rows)
    print("Your own drive: lidarlift compare path/to/drive, or lidarlift run path/to/drive")


def _simulated(frames: int | None) -> tuple[Path, int]:
    """The folder of the demo's drive with at least so many frames (None: all), and how many that are.

    It stays in the user's cache for the next time; the full demo goes on from where a quick or broken one ended.
    """
    from slam.simulation.simulation import Settings, Simulation

    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lidarlift" / "demo"
    messages.print(
        "A car with a 64-channel LiDAR and a camera drives around the block in a simulated town.\n"
        f"Its scans are kept for the next time in {folder}",
        markup=False,
    )
    simulation = Simulation(Settings(drive="loop"))
    if not simulation.matches(folder):
        _remove(folder)
    count = min(frames or len(simulation), len(simulation))
    with progress("Simulating", count) as advance:
        simulation.write(folder, count, advance)
    return folder, count


def _remove(folder: Path) -> None:
    try:
        shutil.rmtree(folder)
    except OSError as error:
        raise InputError(f"{folder}: an outdated simulation that cannot be removed ({error}); remove it") from error
