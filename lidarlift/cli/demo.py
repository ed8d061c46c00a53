"""`lidarlift demo`: 16 channels, enriched and 64 compared on a simulated drive; no data needed."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.compare import print_comparison
from lidarlift.cli.console import Console, messages, progress
from lidarlift.cli.forecast import Forecast
from lidarlift.comparing import INPUTS, compare_into, rows_for, title_of
from slam.data.atomic import require_writable
from slam.data.errors import InputError
from slam.data.machine import cache_folder

if TYPE_CHECKING:
    from slam.settings import Config
    from slam.simulation.simulation import Simulation

NAME = "Simulated loop"
EVERY = 2  # takes every other frame, 1.5 m apart on average: nearly the same figures in half of the time
QUICK = 53  # frames: the first hundred metres, the least that has a drift
AROUND = 280  # frames: once around the block and 80 m on, 40 of them driven twice, which closes loops
#: Seconds on the machine whose speed `Forecast` knows: a core's for a simulated frame; a frame's in each row.
SIMULATED, REGISTERED = 0.23, {"16": 0.03, "ray-segment": 0.055, "lift": 0.2, "64": 0.075}
#: And what the simulation and each row take besides; and what compiling kernels, once, adds to the simulation.
TOWN, ROW, KERNELS = 6.0, 7.0, 25.0


def demo(
    out: Annotated[Path, typer.Option(help="The folder for the runs and their comparison.")] = Path("runs/demo"),
    quick: Annotated[bool, typer.Option("--quick", help="Only the first hundred metres: a minute or two.")] = False,
    full: Annotated[bool, typer.Option("--full", help="All of the drive, at ten frames a second, not five.")] = False,
) -> None:
    """See what it does, without any data: simulate a drive, run it at 16 channels, enriched and at 64, and compare.

    Example: `lidarlift demo --quick`
    """
    if quick and full:
        raise typer.BadParameter("is the whole drive; leave --quick out", param_hint="--full")
    from slam.compilation import compile_kernels
    from slam.data.dataset import open_dataset
    from slam.simulation.simulation import Simulation, SimulationConfig

    rows = rows_for(INPUTS)
    for row in rows:
        require_writable(out / row)
    simulation = Simulation(SimulationConfig(drive="loop", every=1 if full else EVERY))
    town = _kept(simulation, "demo-full" if full else "demo")
    count = min(QUICK if quick else len(simulation) if full else AROUND, len(simulation))
    missing = simulation.missing(town, count)
    forecast = _forecast(rows, count, len(missing), cold=not town.exists())
    messages.print(
        "A car with a 64-channel LiDAR and a camera drives around the block in a simulated town.\n"
        f"Its scans are kept for the next time in {town}\n"
        f"All in all this takes {forecast} here.",
        markup=False,
    )
    compiling = Thread(target=compile_kernels, args=(rows["16"], lambda: None), daemon=True)
    compiling.start()  # others simulate, this process has nothing to do
    with progress("Simulating", count) as advance:
        simulation.write(town, count, advance)
    compiling.join()
    forecast.done("simulation")
    messages.print(
        "LiDAR SLAM on these scans: with 16 of the 64 rings, as a cheap LiDAR has them; with the others filled in; "
        f"and with all as they were measured; {forecast} to go"
    )
    data = open_dataset(town)

    def row_done(row: str) -> None:
        forecast.done(row)
        messages.print(_line(row, out / row) + (f"; {forecast} to go" if forecast.left else ""))

    comparison = compare_into(out, data, rows, slice(count), Console(), name=NAME, on_row=row_done)
    print_comparison(comparison, title_of(data, rows, slice(count), NAME), out, rows)
    print("Your own drive: lidarlift compare path/to/drive, or lidarlift run path/to/drive")


def _kept(simulation: Simulation, name: str) -> Path:
    """The folder in the user's cache where the drive stays for the next time, whole or in part: a demo that was broken
    off goes on, and the whole drive after its beginning. What an older version left there is removed."""
    folder = cache_folder(name)
    if not simulation.matches(folder):
        try:
            shutil.rmtree(folder)
        except OSError as error:
            raise InputError(f"{folder}: an outdated simulation that cannot be removed ({error}); remove it") from error
    return folder


def _forecast(rows: Mapping[str, Config], count: int, missing: int, *, cold: bool) -> Forecast:
    """Of a drive of so many frames, some of them still to be simulated; in a `cold` start kernels are compiled."""
    from slam.simulation.simulation import processes

    seconds = {"simulation": TOWN + SIMULATED * missing / processes() if missing else 0.0}
    for row, settings in rows.items():
        front_end = settings.front_end
        seconds[row] = ROW + REGISTERED[front_end.enricher if front_end.input == "enriched" else row] * count
    if cold:
        seconds["simulation"] += KERNELS
    return Forecast(seconds)


def _line(row: str, folder: Path) -> str:
    """The figures of a run that is done, in short."""
    from eval.compare import compare_runs

    figures = compare_runs({row: folder}).inputs[row]
    drift = "" if figures.drift_percent is None else f", drift {figures.drift_percent:.3f} %"
    return f"{row}: ATE {figures.ate_m:.3f} m{drift}, {figures.loops} loops"
