"""The command line of every script. Imports nothing that starts threads: see cores.py."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path

from slam.data.errors import InputError

RESULTS = Path(__file__).parents[1] / "results"


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Its help is the script's docstring `doc`, whose example says how the script is called."""
    assert doc is not None
    command = re.search(r"python -m benchmarks[\w.]+", doc)
    assert command is not None
    return argparse.ArgumentParser(
        prog=command.group(), description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def add_results(arguments: argparse.ArgumentParser) -> None:
    """--results FOLDER."""
    arguments.add_argument("--results", type=Path, default=RESULTS, metavar="FOLDER", help="where to write")


def run_script(main: Callable[[], None]) -> None:
    """Run a script; an InputError ends it with its one line."""
    try:
        main()
    except InputError as error:
        sys.exit(f"error: {error}")
