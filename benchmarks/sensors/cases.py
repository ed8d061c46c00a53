"""Sequences and subsets of rings on which enriched input is compared with plain and full input."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.simulated import simulated
from slam.data.dataset import Dataset, open_dataset
from slam.simulation.simulation import SimulationConfig

FRAMES = 160  # of a simulated drive: 160 m in a street, 16 s on foot


@dataclass(frozen=True)
class Case:
    """A sequence, and the numbers of rings that are compared.

    Attributes:
        name: Name of the sequence.
        drive: Simulated drive; None: a recording, the folder of which is `name`.
        sensor: Name of the simulated LiDAR.
        kept: Numbers of rings of the sparse inputs.
        starts: First frames of the runs; several show how much the result depends on the start.
        known_lines: Whether the laser lines that a user names are those of the very LiDAR.
    """

    name: str
    drive: str | None = None
    sensor: str = "hdl64"
    kept: tuple[int, ...] = (16, 32)
    starts: tuple[int, ...] = (0,)

    def open(self, folder: Path) -> Dataset:
        """Open the sequence, simulated where its frames are missing; recordings are in `folder`.

        Raises:
            InputError: The recording is not there.
        """
        if self.drive is None:
            return open_dataset(folder / self.name)
        moving = self.sensor != "hdl64"  # the scans of an HDL-64E are motion-compensated, as KITTI's
        settings = SimulationConfig(
            self.drive, sensor=self.sensor, camera=False, distort=moving, format="folder" if moving else "kitti"
        )
        return simulated(f"sensors-{self.drive}-{self.sensor}", settings, range(FRAMES + max(self.starts)))


SHIFTED = (0, 2, 4)  # frames; on foot the result depends on the start
CASES = (
    Case("straight, HDL-64E", "straight"),
    Case("loop, HDL-64E", "loop"),
    Case("straight, VLP-16", "straight", "vlp16", (16,)),
    Case("loop, VLP-16", "loop", "vlp16", (16,)),
    Case("building, VLP-16", "building", "vlp16", (16,), SHIFTED),
    Case("straight, HDL-32E", "straight", "hdl32", (32,)),
    Case("straight, VLP-32C", "straight", "vlp32c", (32,)),
    Case("loop, VLP-32C", "loop", "vlp32c", (32,)),
    Case("building, VLP-32C", "building", "vlp32c", (32,), SHIFTED),
    Case("straight, OS1-32", "straight", "os1-32", (32,)),
    Case("loop, OS1-64", "loop", "os1-64"),
    Case("building, OS1-64", "building", "os1-64", (16, 32), SHIFTED),
    Case("straight, OS1-128", "straight", "os1-128"),
    Case("kitti_odometry_04"),
    Case("kitti_raw_0013"),
    Case("kitti_raw_0005"),
)


def chosen(names: list[str] | None) -> Iterator[Case]:
    """The cases with these names, by default all."""
    return (case for case in CASES if names is None or case.name in names)
