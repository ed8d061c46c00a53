"""The list of commands, and the handling of errors.

The command modules import the computing modules only when a command runs, so that `--help` is fast.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import Annotated

import typer

import lidarlift
from lidarlift.cli.calibrate import calibrate
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
from lidarlift.cli.view import view
from slam.data.errors import InputError

INTERRUPTED = 130  # what shells expect after Ctrl-C, and typer exits with

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""LiDAR SLAM for low-cost LiDARs: estimate trajectory and map of a recorded sequence, and evaluate them.

    Example: `lidarlift run 2011_09_26/2011_09_26_drive_0013_sync --input 16 --out runs/0013`

    Without data: `lidarlift demo`
    """,
)
for command in (run, info, compare, view, enrich, evaluate, export, config, calibrate, fit_lasers, simulate):
    app.command()(command)
for command in (demo, depth_benchmark):
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
    """Options of `lidarlift` without a command."""


def main() -> None:
    """Run the command line.

    Exit codes: 0 done, 1 error (one line on stderr), 2 usage, 128 + the signal's number when stopped: 130 by Ctrl-C,
    143 by SIGTERM, 129 when the terminal is closed. All three end a run with the results so far.
    """
    stopped_by: list[int] = []
    _take_signals(stopped_by)
    try:
        app()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            messages.print("Stopped. All files written so far are complete.")
            sys.stdout.flush()
            # sys.exit would wait for threads, and one may be inside a solver
            os._exit(128 + stopped_by[0] if stopped_by else INTERRUPTED)
        raise
    except InputError as error:
        messages.print(f"Error: {error}", style="red", markup=False)
        sys.exit(1)


def _take_signals(stopped_by: list[int]) -> None:
    """Have SIGTERM and SIGHUP stop the command as Ctrl-C does, unless they are ignored, as by nohup."""

    def stop(number: int, _: object) -> None:
        stopped_by.append(number)
        raise KeyboardInterrupt

    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has one of them
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, stop)
