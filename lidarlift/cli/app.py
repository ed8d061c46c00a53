"""The commands in their order, and what becomes of errors.

So that `--help` is there at once, the modules of the commands import what computes only when a command runs.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

import lidarlift
from lidarlift.cli.compare import compare
from lidarlift.cli.config import config
from lidarlift.cli.console import messages
from lidarlift.cli.demo import demo
from lidarlift.cli.depth_benchmark import depth_benchmark
from lidarlift.cli.enrich import enrich
from lidarlift.cli.evaluate import evaluate
from lidarlift.cli.export import export
from lidarlift.cli.fit_lasers import fit_lasers
from lidarlift.cli.info import info
from lidarlift.cli.run import run
from lidarlift.cli.simulate import simulate
from lidarlift.cli.study import study
from lidarlift.cli.train import train
from slam.data.errors import InputError

INTERRUPTED = 130  # what shells expect after Ctrl-C, and typer exits with

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""LiDAR SLAM for people with a cheap LiDAR: a drive's scans become a trajectory, a map and an honest report.

    Example: `lidarlift run 2011_09_26/2011_09_26_drive_0013_sync --input 16 --out runs/0013`

    No data at hand: `lidarlift demo`
    """,
)
for command in (run, info, compare, enrich, evaluate, export, config, fit_lasers, simulate, demo, depth_benchmark):
    app.command()(command)
app.add_typer(train, name="train")
app.add_typer(study, name="study")


def _print_version(asked: bool) -> None:
    if asked:
        print(f"lidarlift {lidarlift.__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point: 0 done, 1 a clear error on stderr, 2 usage, 130 stopped by Ctrl-C."""
    try:
        app()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            messages.print("Stopped. The files that are there are whole.")
            sys.stdout.flush()
            os._exit(INTERRUPTED)  # sys.exit would wait for threads, one of which may be inside a solver
        raise
    except InputError as error:
        messages.print(f"Error: {error}", style="red", markup=False)
        sys.exit(1)
