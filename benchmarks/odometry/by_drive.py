"""Scripts that measure some systems on inputs of drives: their command line, their loop and their results."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser
from benchmarks.odometry import inputs
from benchmarks.odometry.chosen_drives import ChosenDrive, add_drives, chosen_drives
from benchmarks.odometry.names import OURS, REFERENCE, SYSTEMS

DEFAULT = next(iter(OURS))
TITLES = {DEFAULT: "lidarlift", REFERENCE: "KISS-ICP"}


def measure_by_drive(
    description: str | None,
    name: str,
    measure: Callable[[ChosenDrive, str, str], Any],
    page: Callable[[Mapping[str, Any]], str],
) -> None:
    """Read the command line, measure, and write results after each drive: [drive][input][system].

    Args:
        description: The docstring of the script.
        name: The name of its results.
        measure: Measures a system on an input of a drive: `measure(drive, input, system)`.
        page: Makes the page.
    """
    arguments = parser(description)
    add_drives(arguments)
    inputs.add_inputs(arguments, (inputs.FULL, inputs.SPARSE))
    arguments.add_argument("--systems", nargs="+", default=[DEFAULT, REFERENCE], choices=SYSTEMS)
    add_results(arguments)
    options = arguments.parse_args()
    found: dict[str, Any] = {"about": surroundings(("numpy", "numba", "kiss-icp"))}
    for drive in chosen_drives(options, images=not set(options.inputs) <= set(inputs.IMAGELESS)):
        for each in options.inputs:
            if inputs.why_not(each, drive.data) is None:
                measured = {system: measure(drive, each, system) for system in options.systems}
                found.setdefault(drive.name, {})[each] = measured
                print(drive.name, each, measured, file=sys.stderr)
        write_results(options.results, name, found, page)
