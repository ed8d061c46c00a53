"""Simulated drives, kept in the user's cache."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.data.machine import cache_folder
from slam.simulation.drives import Drive
from slam.simulation.simulation import Simulation, SimulationConfig

CACHE = cache_folder("benchmarks")
TOWNS = ("loop", "jam", "straight")
ALONG = ("05", "06", "07")  # drives of KITTI along whose paths towns grow
SPACING = 1.5  # m between their frames


@dataclass(frozen=True)
class Scene:
    """A simulated drive and which of its frames odometries drive, None: all. Images are added by those who need them.

    Drives with an hdl64 are motion-compensated, as KITTI's odometry benchmark is, the others as recorded. Where lasers
    look aside (OS1, VLP-32C), points have times of their own in a folder; KITTI's files have none.
    """

    settings: SimulationConfig
    frames: slice | None = None


def _by(drive: str, sensor: str, **settings: Any) -> SimulationConfig:
    """The drive as that LiDAR records it while it moves."""
    return SimulationConfig(drive, sensor=sensor, distort=True, camera=False, **settings)


FIRST = slice(240)  # of long drives: what is new in them has come by then, and peers take a second a frame

#: By the names that command lines and pages have.
SCENES = {
    "loop": Scene(SimulationConfig("loop", camera=False), FIRST),
    "straight": Scene(SimulationConfig("straight", camera=False)),
    "jam": Scene(SimulationConfig("jam", camera=False)),
    "crawl": Scene(SimulationConfig("crawl", camera=False), FIRST),
    "motorway": Scene(SimulationConfig("motorway", camera=False)),
    "bridge": Scene(SimulationConfig("bridge", camera=False)),
    "tunnel": Scene(SimulationConfig("tunnel", camera=False), FIRST),
    "lorries": Scene(SimulationConfig("lorries", camera=False)),
    "traffic": Scene(SimulationConfig("traffic", camera=False), FIRST),
    "lorries-vls128": Scene(_by("lorries", "vls128", format="folder")),
    "building-vlp16": Scene(_by("building", "vlp16"), slice(450)),
    "building-os1-64": Scene(_by("building", "os1-64", format="folder"), slice(450)),
    "straight-vlp16": Scene(_by("straight", "vlp16"), FIRST),
    "straight-vlp16-20hz": Scene(_by("straight", "vlp16", rate=20.0), FIRST),
    "straight-vlp32c": Scene(_by("straight", "vlp32c", format="folder"), FIRST),
    "straight-os1-128": Scene(_by("straight", "os1-128", format="folder"), FIRST),
    "tunnel-vlp16": Scene(SimulationConfig("tunnel", sensor="vlp16", camera=False), FIRST),
}


def simulated(name: str, settings: SimulationConfig, frames: Iterable[int] | None = None) -> Dataset:
    """The drive in the cache's folder `name`, all of it or at least these frames, simulated where they are missing."""
    simulation, folder = Simulation(settings), CACHE / name
    print(f"{name}: a drive of {len(simulation)} frames in {folder}", file=sys.stderr)
    numbers = range(len(simulation)) if frames is None else list(frames)
    if _has(folder, simulation, numbers):
        return open_dataset(folder)
    from_start = list(numbers) == list(range(len(numbers)))
    simulation.write(folder, frames=len(numbers) if from_start else 0)  # several processes
    missing = set(simulation.missing(folder))
    for number in numbers:
        if number in missing:
            simulation.write_frame(folder, number)
    return open_dataset(folder)


def scene(name: str, camera: bool | None = False, frames: Iterable[int] | None = None) -> Dataset:
    """One of SCENES, all of it or at least these frames.

    Args:
        name: Of the scene.
        camera: Whether there are images; the scans are the same. None: where they are kept already.
        frames: Their numbers.

    Raises:
        InputError: There is no such scene.
    """
    filmed = replace(_of(name).settings, camera=True)
    folders = {True: f"{name}-camera", False: f"{name}-every-frame"}
    numbers = frame_numbers(name, slice(None)) if frames is None else list(frames)
    if camera is None:
        camera = _has(CACHE / folders[True], Simulation(filmed), numbers)
    return simulated(folders[camera], replace(filmed, camera=camera), numbers)


def along(name: str, trajectories: Path | None) -> Dataset:
    """A town along the path of one of ALONG, LiDAR only.

    Args:
        name: Of the drive.
        trajectories: The folder with kitti_05_ground_truth.txt and the others.

    Raises:
        InputError: Their folder was not named, or does not have it.
    """
    if trajectories is None:
        raise InputError(f"{name}: its path is needed; add --trajectories FOLDER, with kitti_{name}_ground_truth.txt")
    path = trajectories / f"kitti_{name}_ground_truth.txt"
    return simulated(name, SimulationConfig(trajectory=path, spacing=SPACING, camera=False))


def _has(folder: Path, simulation: Simulation, numbers: Iterable[int]) -> bool:
    """Whether the folder holds these frames of the very simulation."""
    return folder.is_dir() and simulation.matches(folder) and not set(simulation.missing(folder)) & set(numbers)


def frame_numbers(name: str, frames: slice | None = None) -> range:
    """The numbers of a scene's frames that `frames` chooses, by default its own."""
    chosen = _of(name)
    return range(len(Simulation(chosen.settings)))[frames or chosen.frames or slice(None)]


def course(name: str) -> Drive:
    """Where one of SCENES leads, all of it, and what it leads through."""
    return Simulation(_of(name).settings).drive


def _of(name: str) -> Scene:
    if name not in SCENES:
        raise InputError(f"{name}: no such simulated drive; there are {', '.join(SCENES)}")
    return SCENES[name]
