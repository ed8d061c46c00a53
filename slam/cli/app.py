"""The commands in their order, and what becomes of errors.

So that `--help` is there at once, the modules of the commands import what computes only when a command runs.
"""

from __future__ import annotations

import sys

import typer

from slam.cli.console import messages
from slam.cli.demo import demo
from slam.cli.evaluate import evaluate
from slam.cli.export import export
from slam.cli.run import run
from slam.cli.simulate import simulate
from slam.data.errors import InputError

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
for command in (run, evaluate, export, simulate, demo):
    app.command()(command)


def main() -> None:
    """Entry point: 0 done, 1 a clear error on stderr, 2 usage."""
    try:
        app()
    except InputError as error:
        messages.print(f"Error: {error}", style="red", markup=False)
        sys.exit(1)
