"""Systems taking turns on the same scans, with a clock on each."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from benchmarks.odometry.names import CHANNELS, SYSTEMS
from benchmarks.odometry.systems import System, build
from slam.config import load_config
from slam.data.cloud import Array, Frame, PointCloud
from slam.data.dataset import Dataset
from slam.front_end import RingFrontEnd

UNCOUNTED = 5  # frames at the start whose time does not count: first maps, imports, start-up search
WARM_UP = 4  # frames before all measurement, for jit compilers and lazy imports

Scan = tuple[PointCloud, float]


@dataclass
class Run:
    """One system's run over a drive.

    statuses  by scan, of who says them, as in `OdometryStep`; None: of who does not
    error     at which scan and why it ended early
    """

    seconds: list[float] = field(default_factory=list)
    poses: list[Array] = field(default_factory=list)
    statuses: list[str | None] = field(default_factory=list)
    error: str | None = None

    def step(self, system: System, scan: Scan) -> None:
        """The next scan, timed from cloud to pose."""
        start = perf_counter()
        try:
            pose = system.register(*scan)
            self.seconds.append(perf_counter() - start)
            if not np.isfinite(pose).all():
                raise FloatingPointError("the pose is not finite")
            for back, step in enumerate(reversed(system.revised), start=1):
                self.poses[-back], self.statuses[-back] = step.pose, step.status
            self.poses.append(pose)
            self.statuses.append(system.status)
        except Exception as error:  # whatever a peer may raise: the others go on
            reason = " ".join(str(error).split()) or "no reason given"
            self.error = f"scan {len(self.poses)}: {type(error).__name__}: {reason}"

    def count(self, status: str) -> int | None:
        """How many scans have that status; None where the system does not say."""
        return None if None in self.statuses else self.statuses.count(status)


def front_end(dataset: Dataset, frames: Sequence[Frame], channels: str) -> list[Scan]:
    """The clouds that all systems are fed, with their stamps [s]."""
    rings = RingFrontEnd(load_config(input=channels).front_end, dataset.sensor)
    return [(rings(frame, ()), frame.stamp) for frame in frames]


def alternate(systems: Mapping[str, System], scans: Iterable[Scan]) -> dict[str, Run]:
    """Scan i goes to each system in turn before scan i + 1 does; who begins changes from scan to scan."""
    names, runs = list(systems), {name: Run() for name in systems}
    for i, scan in enumerate(scans):
        first = i % len(names)
        for name in names[first:] + names[:first]:
            if runs[name].error is None:
                runs[name].step(systems[name], scan)
    return runs


def built(
    names: Sequence[str], channels: str, dataset: Dataset, sweeps: int = 1
) -> tuple[dict[str, System], dict[str, Run]]:
    """Fresh systems as of `build`, and the runs of those that are not installed."""
    ready: dict[str, System] = {}
    missing: dict[str, Run] = {}
    for name in names:
        try:
            ready[name] = build(name, channels, dataset, sweeps)
        except ImportError as error:
            missing[name] = Run(error=f"not installed, see `make peers` ({error})")
    return ready, missing


def warm_up(dataset: Dataset, frames: Sequence[Frame]) -> None:
    """Compile and import everything that is done lazily."""
    for channels in CHANNELS:
        alternate(
            {name: build(name, channels, dataset) for name in SYSTEMS}, front_end(dataset, frames[:WARM_UP], channels)
        )


def measure(dataset: Dataset, frames: Sequence[Frame], channels: str, repeats: int) -> dict[str, list[Run]]:
    """By system its runs, each repeat with fresh systems."""
    scans = front_end(dataset, frames, channels)
    runs: dict[str, list[Run]] = {name: [] for name in SYSTEMS}
    for repeat in range(repeats):
        start = perf_counter()
        gc.collect()
        for name, run in alternate({name: build(name, channels, dataset) for name in SYSTEMS}, scans).items():
            runs[name].append(run)
        took = perf_counter() - start
        print(f"{dataset.name}: {channels} channels, repeat {repeat + 1} of {repeats}: {took:.0f} s", file=sys.stderr)
    return runs
