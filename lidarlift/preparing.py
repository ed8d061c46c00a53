"""Compile the kernels and import the libraries once, after the installation: the first run is then as fast as others.

    python -m lidarlift.preparing

Three frames of the simulated loop are recorded, run with all inputs and reported, as `lidarlift demo` does.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

FRAMES = 3


def prepare() -> None:
    """Simulate, run, enrich, compare and report a few frames in a temporary folder."""
    from lidarlift.comparing import compare
    from slam.simulation.simulation import Simulation, SimulationConfig

    with TemporaryDirectory(prefix="lidarlift-") as name:
        folder = Path(name)
        Simulation(SimulationConfig(drive="loop")).write(folder / "loop", FRAMES)
        compare(folder / "loop", folder / "compared", enricher="lift")


def main() -> int:
    """Prepare; what goes wrong is said in a line, since everything works without it."""
    logging.getLogger("lidarlift").setLevel(logging.ERROR)
    try:
        prepare()
    except Exception as error:
        print(f"The kernels are compiled at the first run: {type(error).__name__}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
