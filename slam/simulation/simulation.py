"""A simulated drive, written frame by frame."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from slam.data.atomic import write_text
from slam.data.conventions import INSTANTS
from slam.data.errors import InputError
from slam.data.machine import usable_cores
from slam.data.sensor_names import SIMULATED
from slam.simulation.drive_names import DRIVES
from slam.simulation.drives import RATE, at_rate, built_in, from_file, thinned
from slam.simulation.fingerprint import fingerprint
from slam.simulation.heads import Lidar
from slam.simulation.layouts import FolderLayout, KittiLayout, Layout
from slam.simulation.rig import Mount, Rig
from slam.simulation.scene import SCENES

FEW = 8  # so many frames are written before other processes have started
MOST = 4  # processes: each holds a town


@dataclass(frozen=True)
class SimulationConfig:
    """What is simulated: equal ones give the same bytes.

    drive       a built-in drive, unless
    trajectory  names a file of poses
    spacing     metres between frames; None: ten frames a second
    every       2 takes every other one of these frames, and so on
    sensor      one of HEADS
    distort     the car moves while the LiDAR turns, as in KITTI's raw drives
    depth       also write the exact depth of each image and the exact 64-channel scan
    camera      take images at all: without, a drive takes a fifth of the time and half of the room
    rate        turns of the LiDAR a second, and frames
    height      of the LiDAR above the ground [m]; None: the drive's own, mostly that of KITTI's car
    tilt        of the LiDAR [rad], positive with its nose down
    format      kitti or folder: see `KittiLayout`, `FolderLayout`
    stamp       start, middle or end: the instant of a sweep that its stamp and pose belong to; kitti's is the middle
    """

    drive: str = "loop"
    trajectory: Path | None = None
    spacing: float | None = None
    every: int = 1
    sensor: str = "hdl64"
    distort: bool = False
    seed: int = 0
    depth: bool = False
    camera: bool = True
    rate: float = RATE
    height: float | None = None
    tilt: float = 0.0
    format: str = "kitti"
    stamp: str = "middle"

    def check(self) -> None:
        """Raise InputError on what does not exist or does not go together."""
        SIMULATED.require(self.sensor)
        if self.format not in ("kitti", "folder") or self.stamp not in INSTANTS:
            raise InputError(f"format '{self.format}', stamp '{self.stamp}': kitti or folder; {', '.join(INSTANTS)}")
        if self.stamp != "middle" and self.format == "kitti":
            raise InputError(f"--stamp {self.stamp}: KITTI's stamps are of mid-sweep; add --format folder")
        if self.stamp != "middle" and not self.distort:
            raise InputError(f"--stamp {self.stamp}: without --distort the LiDAR stands still in a sweep; add that")
        if self.rate != RATE and self.spacing is not None:
            raise InputError(f"--rate {self.rate:g}: --spacing says already where frames are; leave one of them out")
        if not 1 <= self.rate <= 100:
            raise InputError(f"--rate {self.rate:g}: LiDARs turn 1 to 100 times a second, mostly 5 to 20")
        if self.height is not None and not 0 < self.height <= 20:
            raise InputError(f"--height {self.height:g}: a LiDAR is mounted 0 to 20 m above the ground")
        if not abs(self.tilt) < np.pi / 2:
            raise InputError(f"--tilt {np.rad2deg(self.tilt):g}: between -90 and 90 deg")


class Simulation:
    """A drive that can be written. Raises InputError where its trajectory is no drive."""

    def __init__(self, settings: SimulationConfig) -> None:
        settings.check()
        self.settings = settings
        path, spacing = settings.trajectory, settings.spacing
        drive = from_file(path, spacing) if path else built_in(settings.drive, spacing)
        if settings.rate != RATE:
            drive = at_rate(drive, settings.rate)
        self.drive = thinned(drive, settings.every)

    def __len__(self) -> int:
        return len(self.drive)

    @cached_property
    def rig(self) -> Rig:
        """The car in its town, which takes a few seconds to build."""
        settings = self.settings
        return Rig(
            self.drive,
            Lidar.of(settings.sensor, settings.rate),
            settings.seed,
            mount=Mount(settings.height, settings.tilt),
            distort=settings.distort,
            truth=settings.depth,
            camera=settings.camera,
        )

    def matches(self, folder: Path) -> bool:
        """Whether a folder is empty or absent, or holds this very simulation, whole or in part."""
        about = folder / "simulation.json"
        if about.is_file():
            return about.read_text(encoding="utf-8") == self._about()
        return not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))

    def missing(self, folder: Path, frames: int | None = None) -> list[int]:
        """Of the first `frames`, or all, the numbers of those that the folder does not have."""
        return [
            number
            for number in self._numbers(frames)
            if not all(path.is_file() for path in self._files(folder, number))
        ]

    def write(self, folder: Path, frames: int | None = None, on_frame: Callable[[], None] = lambda: None) -> None:
        """The first `frames`, or all; those that the folder has are kept, so that a broken-off run goes on.

        `on_frame` is called for each, kept or written. Raises InputError where the folder holds something else or
        cannot be written; no file is half there then. Frames are shared out among processes, which import the main
        module again: in a script, call this under `if __name__ == "__main__":`.
        """
        if not self.matches(folder):
            raise InputError(f"{folder}: holds something else already; name a new folder, or empty this one")
        missing = self.missing(folder, frames)
        for _ in range(len(self._numbers(frames)) - len(missing)):
            on_frame()
        write_text(folder / "simulation.json", self._about())
        self._layout(folder).write_surroundings(self.rig, self.drive.stamps)
        if len(missing) <= FEW:
            for number in missing:
                self.write_frame(folder, number)
                on_frame()
        else:
            self._share_out(folder, missing, on_frame)

    def write_frame(self, folder: Path, number: int) -> None:
        """One frame into the folder of the simulation."""
        self._layout(folder).write(self.rig.frame(number), number)

    def _share_out(self, folder: Path, numbers: list[int], on_frame: Callable[[], None]) -> None:
        """Frames written by one process a core; those of one stretch by the same, which builds it once."""
        count = processes()
        context = multiprocessing.get_context("spawn")  # a fork would inherit the locks of threads that are not there
        with ExitStack() as stack:
            workers = [ProcessPoolExecutor(1, context, _begin, (self.settings,)) for _ in range(count)]
            for worker in workers:
                stack.callback(worker.shutdown, cancel_futures=True)
            shared = [
                workers[self.rig.stretch(number) % count].submit(_write_one, folder, number) for number in numbers
            ]
            try:
                for written in as_completed(shared):
                    written.result()
                    on_frame()
            except BrokenProcessPool as error:
                message = f"{folder}: a process was killed, for memory perhaps; run it again to go on"
                raise InputError(message) from error

    def _numbers(self, frames: int | None) -> range:
        return range(len(self) if frames is None else min(frames, len(self)))

    def _layout(self, folder: Path) -> Layout:
        settings = self.settings
        if settings.format == "kitti":
            return KittiLayout(folder)
        return FolderLayout(folder, 1 / settings.rate, settings.stamp)

    def _files(self, folder: Path, number: int) -> list[Path]:
        """The files that a frame has with these settings."""
        settings = self.settings
        wanted = {"image": settings.camera, "depth": settings.camera and settings.depth, "exact": settings.depth}
        return [path for part, path in self._layout(folder).files(number).items() if wanted.get(part, True)]

    def _about(self) -> str:
        """What tells this simulation from others: its settings, the way, and the code that makes it."""
        settings = self.settings
        way = hashlib.sha256(self.drive.position.tobytes() + self.drive.yaw.tobytes())
        about = {
            "drive": settings.trajectory.name if settings.trajectory else settings.drive,
            "spacing_m": settings.spacing,
            "every": settings.every,
            "sensor": settings.sensor,
            "distort": settings.distort,
            "seed": settings.seed,
            "depth": settings.depth,
            "camera": settings.camera,
            **self._unusual(),
            "frames": len(self),
            "way": way.hexdigest()[:16],
            "code": fingerprint(__name__, *self._chosen()),
        }
        return json.dumps(about, indent=2) + "\n"

    def _chosen(self) -> list[str]:
        """The modules of what was chosen by name."""
        places = [SCENES.own[self.drive.scene]]
        if not self.settings.trajectory:
            places.append(DRIVES.own[self.settings.drive])
        return [place.split(":")[0] for place in places]

    def _unusual(self) -> dict[str, object]:
        """Of the settings that came later, those that are not as they always were."""
        later = ("rate", "height", "tilt", "format", "stamp")
        values = {name: getattr(self.settings, name) for name in later}
        return {name: value for name, value in values.items() if value != getattr(SimulationConfig, name)}


def processes() -> int:
    """How many write the frames of a drive: one a core, at most MOST."""
    return min(usable_cores(), MOST)


_simulation: Simulation  # of a worker


def _begin(settings: SimulationConfig) -> None:
    global _simulation
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent answers Ctrl-C
    _simulation = Simulation(settings)


def _write_one(folder: Path, number: int) -> None:
    _simulation.write_frame(folder, number)
