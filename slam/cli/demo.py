"""`lidarlift demo`: what 16 channels cost against 64, on a simulated drive; no data needed."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Annotated

import typer

from slam.cli.arguments import require_writable
from slam.cli.console import messages, progress
from slam.cli.run_folder import run_into
from slam.config import load_config
from slam.data.errors import InputError

INPUTS = ("16", "64")
QUICK = 100  # frames


def demo(
    out: Annotated[Path, typer.Option(help="The folder for the runs and their comparison.")] = Path("runs/demo"),
    quick: Annotated[bool, typer.Option("--quick", help=f"Only the first {QUICK} frames: under a minute.")] = False,
) -> None:
    """See what it does, without any data: simulate a drive, run it at 16 and at 64 channels, and compare.

    Example: `lidarlift demo --quick`
    """
    from eval.compare import compare_runs
    from eval.evaluation import write_json
    from eval.tables import format_comparison
    from slam.data.dataset import open_dataset

    folders = {channels: out / channels for channels in INPUTS}
    for folder in folders.values():
        require_writable(folder)
    town, count = _simulated(QUICK if quick else None)
    data = open_dataset(town)
    messages.print("LiDAR SLAM on these scans: with 16 of the 64 rings, as a cheap LiDAR has them, and with all.")
    for channels, folder in folders.items():
        run_into(folder, data, load_config(input=channels), slice(count), name="Simulated loop")

    comparison = compare_runs(folders)
    write_json(out / "compare.json", comparison)
    print(f"\nA simulated drive around the block, {count} frames, against its true poses\n")
    print(format_comparison(comparison))
    for folder in folders.values():
        print(f"{folder}: map.pcd, map.png, trajectory_tum.txt (and _kitti), trajectory.png, loops.csv, metrics.json")
    print(f"{out / 'compare.json'}: the table above")
    print("Your own drive: lidarlift run path/to/drive")


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
