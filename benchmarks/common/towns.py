"""Simulated drives, kept in the user's cache."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from slam.data.dataset import Dataset, open_dataset
from slam.data.machine import cache_folder
from slam.simulation.layouts import SEQUENCE
from slam.simulation.simulation import Simulation, SimulationConfig

CACHE = cache_folder("benchmarks")
TOWNS = ("loop", "jam", "straight")


def simulated(name: str, settings: SimulationConfig, frames: Iterable[int] | None = None) -> Dataset:
    """The drive in the cache's folder `name`, all of it or at least these frames, simulated where they are missing."""
    simulation, folder = Simulation(settings), CACHE / name
    print(f"{name}: a drive of {len(simulation)} frames in {folder}", file=sys.stderr)
    simulation.write(folder, frames=None if frames is None else 0)
    sequence = folder / "sequences" / SEQUENCE
    for number in frames or ():
        if not (sequence / f"velodyne/{number:06d}.bin").is_file():
            simulation.write_frame(folder, number)
    return open_dataset(folder)


def town(drive: str, camera: bool = False, frames: Iterable[int] | None = None) -> Dataset:
    """One of the town's drives; the scans are the same with a camera."""
    name = f"{drive}-{'camera' if camera else 'every-frame'}"
    return simulated(name, SimulationConfig(drive=drive, camera=camera), frames)
