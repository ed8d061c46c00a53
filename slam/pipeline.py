"""A drive from its scans to a trajectory and a map: the line that everything else hangs on."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from slam.data import se3
from slam.data.cloud import HISTORY, Array, Frame, PointCloud
from slam.data.dataset import Dataset
from slam.data.errors import InputError
from slam.data.problem import Problem
from slam.front_end import FrontEnd, RingFrontEnd
from slam.loops.closing import LoopSearch
from slam.loops.verification import Verifier
from slam.mapper import Mapper, Mapping
from slam.mapping.global_map import build_map
from slam.mapping.keyframes import Keyframes
from slam.odometry import Odometry
from slam.recorded_odometry import RecordedOdometry
from slam.settings import Config

STAGES = ("load", "front_end", "odometry", "waiting")  # of a frame, the last for the mapper; this has its own


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """What the odometry made of a frame: pose (4, 4) T_world_lidar and covariance (6, 6) as in OdometryStep,
    milliseconds by stage."""

    index: int
    stamp: float
    pose: Array
    covariance: Array
    status: str
    inlier_ratio: float
    points: int
    milliseconds: dict[str, float]


@dataclass(eq=False)
class Run:
    """What a run over a drive gave."""

    dataset: Dataset
    config: Config
    positions: range
    vertical_correction: float
    deskewed: bool
    mapping: Mapping | None = None
    milliseconds: dict[str, list[float]] = field(default_factory=dict)
    records: list[FrameRecord] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)

    @property
    def odometry_poses(self) -> Array:
        """(N, 4, 4) T_world_lidar before loops, the first identity."""
        return np.array([record.pose for record in self.records])

    @property
    def poses(self) -> Array:
        """(N, 4, 4) T_world_lidar, loops closed; the first identity."""
        return self.mapping.corrected(self.odometry_poses) if self.mapping else self.odometry_poses

    @property
    def map(self) -> PointCloud:
        """Of the whole drive, in the world's frame."""
        return self.mapping.map if self.mapping else PointCloud(np.zeros((0, 3)), np.zeros(0))

    @property
    def stamps(self) -> Array:
        """(N,) seconds."""
        return np.array([record.stamp for record in self.records])

    @property
    def ground_truth(self) -> Array | None:
        """(N, 4, 4) of the same frames, NaN where unknown, or None."""
        return None if self.dataset.ground_truth is None else self.dataset.ground_truth[self.positions]

    def counts(self) -> dict[str, int]:
        """Frames by their status, and problems by their kind."""
        statuses = Counter(record.status for record in self.records)
        kinds = Counter(problem.kind for problem in self.problems)
        known = {name: statuses[name] for name in ("registered", "retried", "failed")}
        return {"frames": len(self.records), **known, **{kind.replace(" ", "_"): n for kind, n in kinds.items()}}


class Pipeline:
    """Runs a configuration over drives. `front_end` replaces the one that the configuration names."""

    def __init__(self, config: Config | None = None, front_end: FrontEnd | None = None) -> None:
        self.config, self.front_end = config or Config(), front_end

    def run(
        self,
        dataset: Dataset,
        frames: slice = slice(None),
        *,
        recorded: RecordedOdometry | None = None,
        strict: bool = False,
        on_frame: Callable[[FrameRecord], None] | None = None,
        on_odometry: Callable[[Run], None] | None = None,
    ) -> Run:
        """Odometry, loops and map over the frames (positions in the data set, as in a list's slice); poses that are
        `recorded` take the odometry's place. `on_odometry` is called when all frames are registered: judging the loops
        and building the map, which follow, may take minutes.

        Runs repeat bit for bit. Raises InputError where no frames are left, where a step asks for what the data do
        not have, and, with `strict`, at the first problem.
        """
        run = self._start(dataset, frames)
        if self.front_end is None and self.config.front_end.input == "enriched":
            raise ValueError("input 'enriched' needs the front end that enriches")
        front_end = self.front_end or RingFrontEnd(self.config.front_end, dataset.sensor)
        about: Any = {"sweep_duration": sweep_duration(dataset), "vertical_correction": run.vertical_correction}
        odometry = recorded.steps(run.positions, **about) if recorded else Odometry(self.config.odometry, **about)
        past: deque[tuple[PointCloud, Array]] = deque(maxlen=HISTORY)
        self._report(run, dataset.problems, strict)

        with Mapper(self.config) as mapper:
            for position, (frame, load) in enumerate(_read_ahead(dataset, run.positions)):
                self._report(run, frame.problems, strict)
                frame = recorded.stamped(frame, run.positions[position]) if recorded else frame
                clock = _Clock(load)
                now_world = se3.inverse(odometry.predict(frame.stamp))
                cloud = front_end(frame, [(then, now_world @ pose) for then, pose in past])
                clock.lap("front_end")
                timed = self._with_times(cloud, frame)
                run.deskewed |= timed.time is not None
                step = odometry.register(timed, frame.stamp)
                clock.lap("odometry")
                mapper.add(position, frame, cloud, step)
                clock.lap("waiting")
                past.append((cloud, step.pose))

                inliers = step.registration.inlier_ratio if step.registration else float("nan")
                record = FrameRecord(
                    frame.index, frame.stamp, step.pose, step.covariance, step.status, inliers, len(cloud), clock.laps
                )
                run.records.append(record)
                if on_frame:
                    on_frame(record)
            if on_odometry:
                on_odometry(run)
            run.mapping, run.milliseconds = mapper.finish(), mapper.milliseconds
        return run

    def _start(self, dataset: Dataset, frames: slice) -> Run:
        positions = range(len(dataset))[frames]
        if len(positions) == 0:
            raise InputError(f"{dataset.path}: no frames in that range; the drive has {len(dataset)}, from 0")
        settings, sensor = self.config.front_end, dataset.sensor
        own = sensor.vertical_correction if sensor else 0.0
        angle = settings.vertical_correction_deg
        return Run(
            dataset=dataset,
            config=self.config,
            positions=positions,
            vertical_correction=own if angle is None else float(np.deg2rad(angle)),
            deskewed=False,
        )

    def _with_times(self, cloud: PointCloud, frame: Frame) -> PointCloud:
        """The cloud with the times that deskewing goes by, or without where it is switched off."""
        if self.config.front_end.deskew is False:
            return replace(cloud, time=None)
        if self.config.front_end.deskew and cloud.time is None and len(cloud):
            raise InputError(f"frame {frame.index}: its points have no times to deskew by; leave front_end.deskew out")
        return cloud

    @staticmethod
    def _report(run: Run, problems: Sequence[Problem], strict: bool) -> None:
        if strict and problems:
            raise InputError(problems[0].message)
        run.problems.extend(problems)


def sweep_duration(dataset: Dataset) -> float:
    """Seconds that one sweep takes: the median of the stamps' differences, missing frames reckoned with."""
    if len(dataset) < 2:
        return 0.1
    duration = float(np.median(np.diff(dataset.stamps) / np.maximum(np.diff(dataset.numbers), 1)))
    return duration if duration > 0 else 0.1


def compile_kernels(config: Config, notify: Callable[[], None]) -> None:
    """Have numba's kernels ready, from its cache or compiled; `notify` is called once where that takes a while."""
    timer = threading.Timer(1.5, notify)
    timer.start()
    try:
        random = np.random.default_rng(0)
        xyz = random.uniform(-10, 10, (2000, 3)).astype(np.float32)
        cloud = PointCloud(xyz, np.zeros(2000), time=np.zeros(2000))
        odometry = Odometry(config.odometry, vertical_correction=0.01)
        for stamp in (0.0, 0.1, 0.2):
            odometry.register(cloud, stamp)
        odometry.target.evict(np.zeros(3), 1.0)
        keyframes = Keyframes(config.keyframes)
        keyframes.add(cloud, np.eye(4), 0, 0.0)
        keyframes.finish()
        search = LoopSearch(config.loops)
        search.next(keyframes)
        Verifier(config.loops.verification).verify(keyframes, 0, 0, np.eye(4))
        build_map(keyframes, keyframes.poses, config.map)
    finally:
        timer.cancel()


def _read_ahead(dataset: Dataset, positions: range) -> Iterator[tuple[Frame, float]]:
    """Frames in order, the next one read while the present one is worked on, with the milliseconds that it took."""

    def read(position: int) -> tuple[Frame, float]:
        begin = time.perf_counter()
        return dataset[position], 1e3 * (time.perf_counter() - begin)

    with ThreadPoolExecutor(1, "read-ahead") as reader:
        coming = deque([reader.submit(read, positions[0])])
        for position in (*positions[1:], None):
            present = coming.popleft().result()
            if position is not None:
                coming.append(reader.submit(read, position))
            yield present


class _Clock:
    """Milliseconds by stage."""

    def __init__(self, load: float) -> None:
        self.laps = {"load": load}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.laps[stage], self._last = 1e3 * (now - self._last), now
