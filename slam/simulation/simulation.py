"""A simulated drive as a folder in the layout of KITTI's odometry benchmark."""

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

import cv2
import numpy as np

from slam.data import se3
from slam.data.atomic import write_text, written_beside
from slam.data.cloud import Array
from slam.data.depth_map import DEPTH_SCALE
from slam.data.errors import InputError
from slam.data.machine import usable_cores
from slam.data.pose_files import kitti_text
from slam.data.sensor import load_sensor
from slam.simulation.camera import CAMERA
from slam.simulation.drives import built_in, from_file, thinned
from slam.simulation.fingerprint import fingerprint
from slam.simulation.rig import TR, Rig
from slam.simulation.scene import SCENES

SEQUENCE = "00"
#: As small as zlib's default makes it, and quicker.
PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY]
FEW = 8  # so many frames are written before other processes have started
MOST = 4  # processes: each holds a town


@dataclass(frozen=True)
class SimulationConfig:
    """What is simulated: equal ones give the same bytes.

    drive       a built-in drive, unless
    trajectory  names a file of poses
    spacing     metres between frames; None: ten frames a second
    every       2 takes every other one of these frames, and so on
    sensor      hdl64 or vlp16
    distort     the car moves while the LiDAR turns, as in KITTI's raw drives
    depth       also write the exact depth of each image and the exact 64-channel scan
    camera      take images at all: without, a drive takes a fifth of the time and half of the room
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


class Simulation:
    """A drive that can be written. Raises InputError where its trajectory is no drive."""

    def __init__(self, settings: SimulationConfig) -> None:
        self.settings = settings
        path, spacing = settings.trajectory, settings.spacing
        drive = from_file(path, spacing) if path else built_in(settings.drive, spacing)
        self.drive = thinned(drive, settings.every)

    def __len__(self) -> int:
        return len(self.drive)

    @cached_property
    def rig(self) -> Rig:
        """The car in its town, which takes a few seconds to build."""
        settings = self.settings
        sensor = load_sensor(settings.sensor)
        return Rig(
            self.drive, sensor, settings.seed, distort=settings.distort, truth=settings.depth, camera=settings.camera
        )

    def matches(self, folder: Path) -> bool:
        """Whether a folder is empty or absent, or holds this very simulation, whole or in part."""
        about = folder / "simulation.json"
        if about.is_file():
            return about.read_text(encoding="utf-8") == self._about()
        return not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))

    def missing(self, folder: Path, frames: int | None = None) -> list[int]:
        """Of the first `frames`, or all, the numbers of those that the folder does not have."""
        sequence = folder / "sequences" / SEQUENCE
        return [
            number
            for number in self._numbers(frames)
            if not all(path.is_file() for path in self._files(sequence, number))
        ]

    def write(self, folder: Path, frames: int | None = None, on_frame: Callable[[], None] = lambda: None) -> None:
        """The first `frames`, or all; those that the folder has are kept, so that a broken-off run goes on.

        `on_frame` is called for each, kept or written. Raises InputError where the folder holds something else or
        cannot be written; no file is half there then. Frames are shared out among processes, which import the main
        module again: in a script, call this under `if __name__ == "__main__":`.
        """
        if not self.matches(folder):
            raise InputError(f"{folder}: holds something else already; name a new folder, or empty this one")
        sequence, missing = folder / "sequences" / SEQUENCE, self.missing(folder, frames)
        for _ in range(len(self._numbers(frames)) - len(missing)):
            on_frame()
        self._write_surroundings(folder, sequence)
        if len(missing) <= FEW:
            for number in missing:
                self.write_frame(sequence, number)
                on_frame()
        else:
            self._share_out(sequence, missing, on_frame)

    def write_frame(self, sequence: Path, number: int) -> None:
        """One frame into the folder of its sequence; its scan, which comes last, says that it is whole."""
        frame = self.rig.frame(number)
        values = {
            "image_2": frame.image,
            "depth_2": frame.depth,
            "velodyne_exact": frame.exact,
            "velodyne": frame.scan,
        }
        for path in self._files(sequence, number):
            _write(path, values[path.parent.name])

    def _share_out(self, sequence: Path, numbers: list[int], on_frame: Callable[[], None]) -> None:
        """Frames written by one process a core; those of one stretch by the same, which builds it once."""
        count = processes()
        context = multiprocessing.get_context("spawn")  # a fork would inherit the locks of threads that are not there
        with ExitStack() as stack:
            workers = [ProcessPoolExecutor(1, context, _begin, (self.settings,)) for _ in range(count)]
            for worker in workers:
                stack.callback(worker.shutdown, cancel_futures=True)
            shared = [
                workers[self.rig.stretch(number) % count].submit(_write_one, sequence, number) for number in numbers
            ]
            try:
                for written in as_completed(shared):
                    written.result()
                    on_frame()
            except BrokenProcessPool as error:
                message = f"{sequence}: a process was killed, for memory perhaps; run it again to go on"
                raise InputError(message) from error

    def _numbers(self, frames: int | None) -> range:
        return range(len(self) if frames is None else min(frames, len(self)))

    def _files(self, sequence: Path, number: int) -> tuple[Path, ...]:
        """The files of a frame, in the order in which they are written."""
        settings = self.settings
        parts = {
            "image_2/{:06d}.png": settings.camera,
            "depth_2/{:06d}.png": settings.camera and settings.depth,
            "velodyne_exact/{:06d}.bin": settings.depth,
            "velodyne/{:06d}.bin": True,
        }
        return tuple(sequence / name.format(number) for name, wanted in parts.items() if wanted)

    def _write_surroundings(self, folder: Path, sequence: Path) -> None:
        """All but the frames: what they are, calibration, stamps, sensor and true poses of the whole drive."""
        write_text(folder / "simulation.json", self._about())
        rows = {"P0": CAMERA.P2 * [1, 1, 1, 0], "P2": CAMERA.P2, "Tr": TR[:3]}
        lines = (f"{name}: " + " ".join(f"{value:.12e}" for value in row.ravel()) for name, row in rows.items())
        write_text(sequence / "calib.txt", "\n".join(lines) + "\n")
        write_text(sequence / "times.txt", "".join(f"{stamp:e}\n" for stamp in self.drive.stamps))
        compensated = "false" if self.settings.distort else "true"
        write_text(
            sequence / "sensor.yaml",
            f"model: {self.settings.sensor}\nvertical_correction_deg: 0.0\nmotion_compensated: {compensated}\n",
        )
        poses = TR @ self.rig.poses @ se3.inverse(TR)
        write_text(folder / "poses" / f"{SEQUENCE}.txt", kitti_text(se3.inverse(poses[0]) @ poses))

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
            "frames": len(self),
            "way": way.hexdigest()[:16],
            "code": fingerprint(__name__, SCENES.own[self.drive.scene].split(":")[0]),
        }
        return json.dumps(about, indent=2) + "\n"


def processes() -> int:
    """How many write the frames of a drive: one a core, at most MOST."""
    return min(usable_cores(), MOST)


_simulation: Simulation  # of a worker


def _begin(settings: SimulationConfig) -> None:
    global _simulation
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent answers Ctrl-C
    _simulation = Simulation(settings)


def _write_one(sequence: Path, number: int) -> None:
    _simulation.write_frame(sequence, number)


def _write(path: Path, values: Array | None) -> None:
    """Points (N, 4) float32 as .bin; an image (H, W, 3) uint8 RGB or a depth map (H, W) float32 [m] as .png."""
    assert values is not None
    if path.suffix == ".bin":
        content = values.tobytes()
    else:
        depth = np.minimum(np.round(values * DEPTH_SCALE), 65535).astype(np.uint16) if values.ndim == 2 else None
        content = cv2.imencode(".png", values[..., ::-1] if depth is None else depth, PNG)[1].tobytes()
    with written_beside(path) as temporary:
        temporary.write_bytes(content)
