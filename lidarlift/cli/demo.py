"""`lidarlift demo`: comparison of 16 channels, enriched and 64 channels on a simulated sequence; needs no data."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.compare import print_comparison
from lidarlift.cli.console import Console, command_line, messages, progress
from lidarlift.cli.forecast import Forecast
from lidarlift.comparing import INPUTS, compare_into, comparison_title, rows_for
from slam.data.atomic import require_no_links, require_writable
from slam.data.errors import InputError
from slam.data.machine import cache_folder

if TYPE_CHECKING:
    from slam.settings import Config
    from slam.simulation.simulation import Simulation

NAME = "Simulated loop"
EVERY = 2  # use every second frame, 1.5 m apart on average: nearly the same figures in half of the time
QUICK = 53  # frames: the first hundred metres, the shortest length for which drift is defined
AROUND = 280  # frames: once around the block and 80 m further, of which 40 m are driven twice and close loops
#: Seconds on the reference machine of `Forecast`: to simulate a frame on one core, and to process one in each row.
SIMULATED, REGISTERED = 0.23, {"16": 0.03, "ray-segment": 0.055, "lift": 0.2, "64": 0.075}
#: Fixed seconds of the simulation and of each row, and of compiling the kernels once, during the simulation.
TOWN, ROW, KERNELS = 6.0, 7.0, 25.0


def demo(
    out: Annotated[Path, typer.Option(help="Folder for the runs and their comparison.")] = Path("runs/demo"),
    quick: Annotated[bool, typer.Option("--quick", help="Use the first hundred metres only: a minute or two.")] = False,
    full: Annotated[bool, typer.Option("--full", help="Use the whole sequence at 10 instead of 5 Hz.")] = False,
) -> None:
    """Try lidarlift without data: simulate a sequence, run it at 16 channels, enriched and at 64, and compare.

    Example: `lidarlift demo --quick`
    """
    if quick and full:
        raise typer.BadParameter("uses the whole sequence; leave --quick out", param_hint="--full")
    from slam.compilation import compile_kernels
    from slam.data.dataset import open_dataset
    from slam.simulation.simulation import Simulation, SimulationConfig

    rows = rows_for(INPUTS)
    require_no_links(out, rows)
    for row in rows:
        require_writable(out / row)
    simulation = Simulation(SimulationConfig(drive="loop", every=1 if full else EVERY))
    town = _kept(simulation, "demo-full" if full else "demo")
    count = min(QUICK if quick else len(simulation) if full else AROUND, len(simulation))
    missing = simulation.missing(town, count)
    forecast = _forecast(rows, count, len(missing), cold=not town.exists())
    messages.print(
        "A car with a 64-channel LiDAR and a camera drives around the block in a simulated town.\n"
        f"The scans are kept for later demos in {town}\n"
        f"The demo takes {forecast} on this machine.",
        markup=False,
    )
    compiling = Thread(target=compile_kernels, args=(rows["16"], lambda: None), daemon=True)
    compiling.start()  # worker processes simulate, this process is idle meanwhile
    with progress("Simulating", count) as advance:
        simulation.write(town, count, advance)
    compiling.join()
    forecast.done("simulation")
    messages.print(
        "LiDAR SLAM on these scans: with 16 of the 64 rings, as a low-cost LiDAR has; with these enriched; "
        f"and with all 64 measured rings; {forecast} left"
    )
    data = open_dataset(town)

    def row_done(row: str) -> None:
        forecast.done(row)
        messages.print(_line(row, out / row) + (f"; {forecast} left" if forecast.left else ""))

    frames, command = slice(count), command_line()
    comparison = compare_into(out, data, rows, frames, Console(), name=NAME, on_row=row_done, command=command)
    print_comparison(comparison, comparison_title(data, rows, slice(count), NAME), out, rows)
    print("With your own data: lidarlift compare path/to/sequence, or lidarlift run path/to/sequence")


def _kept(simulation: Simulation, name: str) -> Path:
    """The cache folder that keeps the simulated frames, so that an interrupted or longer demo continues from them.

    A simulation of an older version is removed.
    """
    folder = cache_folder(name)
    if not simulation.matches(folder):
        try:
            shutil.rmtree(folder)
        except OSError as error:
            raise InputError(f"{folder}: cannot remove an outdated simulation ({error}); remove it yourself") from error
    return folder


def _forecast(rows: Mapping[str, Config], count: int, missing: int, *, cold: bool) -> Forecast:
    """Remaining time for `count` frames, `missing` of which are to be simulated; `cold`: kernels are to be compiled."""
    from slam.simulation.simulation import processes

    seconds = {"simulation": TOWN + SIMULATED * missing / processes() if missing else 0.0}
    for row, settings in rows.items():
        front_end = settings.front_end
        seconds[row] = ROW + REGISTERED[front_end.enricher if front_end.input == "enriched" else row] * count
    if cold:
        seconds["simulation"] += KERNELS
    return Forecast(seconds)


def _line(row: str, folder: Path) -> str:
    """One line with the figures of a finished run."""
    from eval.compare import compare_runs

    figures = compare_runs({row: folder}).inputs[row]
    drift = "" if figures.drift_percent is None else f", drift {figures.drift_percent:.3f} %"
    return f"{row}: ATE {figures.ate_m:.3f} m{drift}, {figures.loops} loops"
