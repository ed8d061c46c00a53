"""Simulation of a sequence, written frame by frame."""

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
from slam.data.cloud import Array
from slam.data.conventions import INSTANTS
from slam.data.errors import InputError
from slam.data.machine import usable_cores
from slam.data.recordings.writer import FORMS
from slam.data.sensor_names import SENSORS
from slam.data.yaml_files import suggest
from slam.simulation.drive_names import DRIVES
from slam.simulation.drivers import DRIVERS, Timing, usual_driver
from slam.simulation.drives import RATE, at_rate, built_in, from_file, thinned
from slam.simulation.fingerprint import fingerprint
from slam.simulation.heads import Lidar
from slam.simulation.layouts import FolderLayout, KittiLayout, Layout
from slam.simulation.lidar import Scan
from slam.simulation.recorded_layout import RecordedLayout
from slam.simulation.rig import Mount, Rig
from slam.simulation.scene import SCENES

FORMATS = ("kitti", "folder", *FORMS)
FEW = 8  # frames that are written before other processes have started
MOST = 4  # processes: each holds a town


@dataclass(frozen=True)
class SimulationConfig:
    """Settings of a simulation; equal settings give the same bytes.

    Attributes:
        drive: Name of a built-in drive.
        trajectory: A file of poses that replaces the built-in drive.
        spacing: Distance between frames [m]; None: ten frames per second.
        every: Keep every `every`-th of these frames.
        sensor: Name of the LiDAR, one of HEADS.
        distort: The sensor moves during a sweep, as in KITTI's raw recordings.
        depth: Also write the exact depth of each image and an exact 64-channel scan.
        camera: Write images; without them a simulation takes a fifth of the time and half of the disk space.
        seed: Random seed of scene, traffic and noise.
        rate: Rotation rate of the LiDAR and frame rate [Hz].
        height: Height of the LiDAR above the ground [m]; None: the drive's default, mostly that of KITTI's car.
        tilt: Pitch of the LiDAR [rad], positive downwards.
        format: One of FORMATS, see `KittiLayout`, `FolderLayout`, `RecordedLayout`.
        stamp: start, middle or end: the instant of a sweep to which stamp and pose refer; the middle for kitti. None:
            the driver's, else the middle.
        driver: Name of the driver whose fields the points have, one of DRIVERS. None: none in a folder, the LiDAR's
            in a recording.
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
    stamp: str | None = None
    driver: str | None = None

    def check(self) -> None:
        """Check the settings.

        Raises:
            InputError: A value does not exist, or two settings conflict.
        """
        SENSORS.require(self.sensor)
        if self.format not in FORMATS or self.stamp not in (None, *INSTANTS):
            raise InputError(
                f"format '{self.format}', stamp '{self.stamp}': {', '.join(FORMATS)}; {', '.join(INSTANTS)}"
            )
        if self.driver not in (None, *DRIVERS):
            raise InputError(f"--driver {self.driver}{suggest(self.driver or '', DRIVERS)}")
        if self.driver is not None and self.format == "kitti":
            raise InputError(f"--driver {self.driver}: KITTI's scans have no fields; add --format folder, bag or mcap")
        if self.stamp not in (None, "middle") and self.format == "kitti":
            raise InputError(f"--stamp {self.stamp}: KITTI's stamps are at mid-sweep; add --format folder")
        if self.stamp not in (None, "middle") and not self.distort:
            raise InputError(f"--stamp {self.stamp}: the LiDAR does not move during a sweep; add --distort")
        if self.used_driver:
            DRIVERS[self.used_driver].stamp_or(self.stamp, self.used_driver)
        if self.rate != RATE and self.spacing is not None:
            raise InputError(f"--rate {self.rate:g}: conflicts with --spacing; leave one of the two out")
        if not 1 <= self.rate <= 100:
            raise InputError(f"--rate {self.rate:g}: give 1 to 100 Hz; spinning LiDARs turn at 5 to 20 Hz")
        if self.height is not None and not 0 < self.height <= 20:
            raise InputError(f"--height {self.height:g}: give 0 to 20 m above the ground")
        if not abs(self.tilt) < np.pi / 2:
            raise InputError(f"--tilt {np.rad2deg(self.tilt):g}: give -90 to 90 deg")

    @property
    def used_driver(self) -> str | None:
        """The name of the driver whose fields points have, None for none."""
        return self.driver or (usual_driver(self.sensor) if self.format in FORMS else None)

    @property
    def used_stamp(self) -> str:
        """The instant of a sweep that its stamp belongs to."""
        if not self.used_driver:
            return self.stamp or "middle"
        driver = DRIVERS[self.used_driver]
        return driver.stamp_or(self.stamp, self.used_driver) if self.distort or driver.fixed else "middle"


class Simulation:
    """A simulation that can be written.

    Args:
        settings: The settings.

    Raises:
        InputError: A setting is invalid, or the trajectory cannot be used.
    """

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
        """The sensor rig in its scene, which takes a few seconds to build."""
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
        """Check whether a folder is empty or absent, or holds this simulation, complete or in part."""
        about = folder / "simulation.json"
        if about.is_file():
            return about.read_text(encoding="utf-8") == self._about()
        return not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))

    def missing(self, folder: Path, frames: int | None = None) -> list[int]:
        """Return the numbers of the first `frames` frames, or of all, that are not in the folder."""
        numbers = self._numbers(frames)
        if self._layout(folder).holds(len(numbers)):
            return []
        return [number for number in numbers if not all(path.is_file() for path in self._files(folder, number))]

    def write(self, folder: Path, frames: int | None = None, on_frame: Callable[[], None] = lambda: None) -> None:
        """Write frames in parallel processes; frames in the folder are kept, so an interrupted simulation is resumed.

        The processes import the main module again: in a script, call this under `if __name__ == "__main__":`.

        Args:
            folder: The folder.
            frames: Number of frames; None: all.
            on_frame: Called for each frame, kept or written.

        Raises:
            InputError: The folder has other content, or cannot be written; no file is incomplete then.
        """
        if not self.matches(folder):
            raise InputError(f"{folder}: has other content; choose a new folder, or empty this one")
        layout = self._layout(folder)
        missing = self.missing(folder, frames)
        for _ in range(len(self._numbers(frames)) - len(missing)):
            on_frame()
        write_text(folder / "simulation.json", self._about())
        layout.write_surroundings(self.rig, self.drive.stamps)
        if len(missing) <= FEW:
            for number in missing:
                self.write_frame(folder, number)
                on_frame()
        else:
            self._share_out(folder, missing, on_frame)
        layout.put_together(self.rig, len(self._numbers(frames)))

    def write_frame(self, folder: Path, number: int) -> None:
        """Write one frame into the folder of the simulation."""
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
        period, stamp = 1 / settings.rate, settings.used_stamp
        if settings.format == "folder":
            return FolderLayout(folder, period, stamp, self._fill if settings.driver else None)
        driver = DRIVERS[str(settings.used_driver)]
        return RecordedLayout(folder, settings.format, driver, self._fill, period, stamp, settings.seed)

    def _fill(self, scan: Scan, number: int) -> Array:
        """The points of a scan in the fields of the driver."""
        settings = self.settings
        lidar, period = Lidar.of(settings.sensor, settings.rate), 1 / settings.rate
        instant = INSTANTS[settings.used_stamp]
        rings, moving = lidar.sensor.ring_count, settings.distort
        timing = Timing(number * period, instant, period, rings, lidar.columns, moving)
        return DRIVERS[str(settings.used_driver)].fill(scan, timing)

    def _files(self, folder: Path, number: int) -> list[Path]:
        """The files that a frame has with these settings."""
        settings = self.settings
        wanted = {"image": settings.camera, "depth": settings.camera and settings.depth, "exact": settings.depth}
        return [path for part, path in self._layout(folder).files(number).items() if wanted.get(part, True)]

    def _about(self) -> str:
        """Identity of this simulation: its settings, the path, and the fingerprint of its code."""
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
        """Settings added in later versions that differ from their defaults."""
        later = ("rate", "height", "tilt", "format")
        values: dict[str, object] = {name: getattr(self.settings, name) for name in later}
        unusual = {name: value for name, value in values.items() if value != getattr(SimulationConfig, name)}
        stamp, driver = self.settings.used_stamp, self.settings.used_driver
        return unusual | ({"stamp": stamp} if stamp != "middle" else {}) | ({"driver": driver} if driver else {})


def processes() -> int:
    """Return the number of processes that write frames: one per core, at most MOST."""
    return min(usable_cores(), MOST)


_simulation: Simulation  # of a worker


def _begin(settings: SimulationConfig) -> None:
    global _simulation
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent answers Ctrl-C
    _simulation = Simulation(settings)


def _write_one(folder: Path, number: int) -> None:
    _simulation.write_frame(folder, number)
