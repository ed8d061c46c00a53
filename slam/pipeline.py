"""SLAM frame by frame, live or over a data set."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import numpy as np

from slam.data.cloud import Array, Frame, PointCloud
from slam.data.dataset import Dataset, chosen_positions
from slam.data.errors import InputError
from slam.data.images import ReportingReader
from slam.data.problem import Problem
from slam.data.sensor import Sensor
from slam.data.stamps import stamp_problems, usual_step
from slam.data.world_frame import centre, world_frame_problem
from slam.frame_record import problems_in, records_in, row_of
from slam.front_end import FrontEnd, RingFrontEnd
from slam.identity import fingerprint
from slam.journal.journal import Journal
from slam.journal.state import freeze
from slam.journal.tables import FRAME, PROBLEM
from slam.mapper import Mapper
from slam.mid_sweep import MidSweepOdometry
from slam.odometry import Odometry, OdometryStep
from slam.recorded_odometry import RecordedOdometry
from slam.run import FrameRecord, Observer, Run, Source
from slam.settings import Config, FrontEndSettings
from slam.tracking import PoseSource, Tracker

SWEEP = 0.1  # s; most spinning LiDARs rotate at 10 Hz
MIN_SWEEP = 0.04  # s; hardly any LiDAR rotates faster
MAX_SPAN = 5.0  # sweeps between the first and the last point of a scan


class Slam:
    """LiDAR SLAM, one frame after the other.

    Front end and odometry process each frame immediately; keyframes, loop closures and the pose graph follow in a
    separate thread. Results are deterministic, bit for bit: they depend on the frames, not on the timing.

    Use it in a `with` statement, so that an exception stops the thread. One thread at a time adds frames.

    Args:
        config: The settings. Default: `Config()`.
        front_end: Makes the cloud that is registered, for this run only. Default: the rings set by `config`.
        source: Origin of the frames, for the run folder.
        sweep_duration: Time [s] between successive scans, without missing scans.
        odometry: Source of the poses. Default: our odometry with the settings of `config`.
        strict: Raise an error at the first problem of a frame.
        journal: Receives all that the run finds out. If it has a snapshot, the run continues from there: the next frame
            is the one after those in `result`.
        observer: Watches the run.

    Raises:
        InputError: `config` requires rings that the sensor does not have, or the journal is damaged.
        ValueError: `config` requires enriched input, and no front end that enriches is given.
    """

    def __init__(
        self,
        config: Config | None = None,
        front_end: FrontEnd | None = None,
        *,
        source: Source | None = None,
        sweep_duration: float = SWEEP,
        odometry: PoseSource | None = None,
        strict: bool = False,
        journal: Journal | None = None,
        observer: Observer | None = None,
    ) -> None:
        config, source = config or Config(), source or Source()
        if front_end is None and config.front_end.input == "enriched":
            raise ValueError(
                "input 'enriched' requires a front end that enriches; lidarlift.run and lidarlift.Slam have one"
            )
        angle = vertical_correction(config.front_end, source.sensor)
        self.result = Run(source, config, angle)
        self._tracker = Tracker(
            front_end or RingFrontEnd(config.front_end, source.sensor),
            odometry
            or MidSweepOdometry(Odometry(config.odometry, sweep_duration=sweep_duration, vertical_correction=angle)),
            config.front_end.deskew,
        )
        self._mapper = Mapper(config, observer.loops_closed if observer else None, journal)
        self._journal, self._observer = journal, observer
        if observer:
            observer.started(self.result)
        self._waiting: list[tuple[int, Frame, PointCloud]] = []  # with provisional poses; their positions
        self._images: list[ReportingReader] = []  # without a problem so far; reading them may find damage
        self._late_problems: list[Problem] = []  # of images that were read for keyframes before the run was resumed
        self._centres: list[Array] = []
        self._sweep_duration, self._strict = sweep_duration, strict
        self._busy = threading.Lock()
        if journal and journal.state:
            self._restore(journal, journal.state)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._mapper.__exit__(kind, value, trace)

    def add(self, frame: Frame, load_milliseconds: float = 0.0) -> FrameRecord:
        """Register the next frame.

        Args:
            frame: Points as recorded, in the sensor's frame, with their stamp, and the image. The pose is that of the
                sensor at the stamp; the points' times are in seconds relative to the stamp.
            load_milliseconds: Time [ms] to read the frame, for the timings.

        Returns:
            Pose, covariance and status, before any loop that this frame may close. At the beginning of a sequence they
            may be revised a few frames later, in `result.records`.

        Raises:
            InputError: The stamp is not finite; the points' times are not in seconds; deskewing is required and the
                points have no times; or `strict` is set and the frame has a problem.
            ValueError: The run is finished.
            RuntimeError: Another thread is adding a frame. Exceptions of the mapper's thread are raised here too.
        """
        with self._alone():
            return self._add(frame, load_milliseconds)

    def _add(self, frame: Frame, load_milliseconds: float) -> FrameRecord:
        if self.result.mapping:
            raise ValueError("the run is finished; create another Slam")
        self._mapper.check()
        if not np.isfinite(frame.stamp):
            raise InputError(f"frame {frame.index}: the stamp is {frame.stamp}; give the scan's time in seconds")
        _check_times(frame, self._sweep_duration)
        before = self.result.records[-1] if self.result.records else None
        problems = (*frame.problems, *stamp_problems(frame, before, self._sweep_duration))
        _raise_if_strict(problems, self._strict)
        self.result.problems.extend(problems)
        images = [reader for reader in frame.image_readers if isinstance(reader, ReportingReader)]
        unread = [image for image in images if image.problem is None]  # others are already problems of the frame
        self._centres.append(centre(frame.cloud.xyz))
        tracked = self._tracker(frame)
        self._images.extend(unread)
        self._add_image_problems(unread)
        self.result.timed += tracked.timed
        self.result.sizes = self._tracker.sizes

        step, position = tracked.step, len(self.result.records)
        laps = {"load": load_milliseconds, **tracked.milliseconds}
        points = len(tracked.cloud)
        self.result.records.append(
            FrameRecord(frame.index, frame.stamp, **_record_fields(step), points=points, milliseconds=laps)
        )
        self._waiting.append((position, frame, tracked.cloud))
        begin = time.perf_counter()
        if not step.provisional:
            self._pass_to_mapper((*step.revised, step))
        laps["waiting"] = 1e3 * (time.perf_counter() - begin)
        if self._journal and not self._waiting:
            self._write_frames(self._journal)
            self._write_problems(self._journal)
            if self._journal.snapshot_due():
                self._snapshot(self._journal, frame)
        if self._observer:
            self._observer.registered(frame, step.cloud, self.result.records[-1])
        return self.result.records[-1]

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Refuse a second thread: the result would depend on which one is first."""
        if not self._busy.acquire(blocking=False):
            raise RuntimeError("Slam is in use by another thread; add frames from one thread, in their order")
        try:
            yield
        finally:
            self._busy.release()

    def _write_frames(self, journal: Journal) -> None:
        """Append the frames to the journal whose poses are final."""
        for record in self.result.records[journal.counts()[FRAME.name] :]:
            journal.append(FRAME, *row_of(record))

    def _write_problems(self, journal: Journal) -> None:
        """Append the new problems to the journal."""
        for problem in self.result.problems[journal.counts()[PROBLEM.name] :]:
            journal.append(PROBLEM, problem.kind, problem.message)

    def _snapshot(self, journal: Journal, last: Frame) -> None:
        """Write a snapshot after the frame `last`, once that is mapped."""
        counts, images, known = journal.counts(), list(self._images), list(self._late_problems)
        own = {"centres": np.array(self._centres), "timed": self.result.timed, "last": fingerprint(last.cloud)}
        self._mapper.snapshot(
            {"run": freeze(own), "tracker": freeze(self._tracker.state())},
            {table.name: counts[table.name] for table in (FRAME, PROBLEM)},
            lambda: [*known, *(image.problem for image in images if image.problem)],
        )

    def _restore(self, journal: Journal, state: Mapping[str, Any]) -> None:
        """Continue from a snapshot."""
        self._tracker.restore(state["tracker"])
        self.result.records, self.result.problems = records_in(journal.file), problems_in(journal.file)
        self.result.timed, self.result.sizes = state["run"]["timed"], self._tracker.sizes
        self._centres, self._late_problems = list(state["run"]["centres"]), state["late"]

    def _pass_to_mapper(self, steps: tuple[OdometryStep, ...]) -> None:
        """Pass the waiting frames to the mapper with their final odometry poses, and update the records."""
        for (position, frame, cloud), step in zip(self._waiting, steps, strict=True):
            self.result.records[position] = replace(self.result.records[position], **_record_fields(step))
            self._mapper.add(position, frame, cloud, step)
        self._waiting.clear()

    def trajectory(self) -> Array:
        """Return T_world_lidar (N, 4, 4) of all frames so far, with all loops closed so far; the first is the identity.

        Waits until all keyframes so far are searched for loops, the time of a few frames. Later results do not depend
        on calls of this method.
        """
        return self.result.poses if self.result.mapping else self._mapper.corrected(self.result.odometry_poses)

    def finish(self) -> Run:
        """Close the last loops, select the consistent loops jointly, and build the map; return the result."""
        with self._alone():
            if self.result.mapping is None:
                self._pass_to_mapper(self._tracker.settle())
                if self._journal:
                    self._write_frames(self._journal)
                self.result.mapping, self.result.milliseconds = self._mapper.finish(), self._mapper.milliseconds
                self._mapper.close()
                _raise_if_strict(self._late_problems, self._strict)
                self.result.problems.extend(self._late_problems)
                self._add_image_problems(self._images)
                self.result.problems.extend(world_frame_problem(np.array(self._centres), self.result.odometry_poses))
                if self._observer:
                    self._observer.finished(self.result)
            return self.result

    def _add_image_problems(self, images: Sequence[ReportingReader]) -> None:
        """Add the problems found while reading images to the run, each once."""
        problems = [image.problem for image in images if image.problem]
        if problems:
            self._images = [image for image in self._images if image.problem not in problems]
        _raise_if_strict(problems, self._strict)
        self.result.problems.extend(problems)


class Pipeline:
    """Runs a configuration over data sets; runs are independent of each other.

    Args:
        config: The settings. Default: `Config()`.
        make_front_end: Creates the front end of each run, since a front end may adapt to its scans. Default: the rings
            set by the configuration.
    """

    def __init__(self, config: Config | None = None, make_front_end: Callable[[], FrontEnd] | None = None) -> None:
        self.config, self.make_front_end = config or Config(), make_front_end

    def run(
        self,
        dataset: Dataset,
        frames: slice = slice(None),
        *,
        recorded: RecordedOdometry | None = None,
        strict: bool = False,
        journal: Journal | None = None,
        observer: Observer | None = None,
        on_frame: Callable[[FrameRecord], None] | None = None,
        on_odometry: Callable[[Run], None] | None = None,
        on_stop: Callable[[Run], None] | None = None,
    ) -> Run:
        """Run `Slam` over the frames of a data set.

        Args:
            dataset: The data set.
            frames: Positions in the data set, as in a list's slice.
            recorded: Poses of another odometry, in place of ours.
            strict: Raise an error at the first problem of the data.
            journal: As in `Slam`; the run continues from its snapshot, if it has one.
            observer: Watches the run.
            on_frame: Called after each frame, and before the first one for each frame of the snapshot.
            on_odometry: Called when all frames are registered. The selection of loops and the map follow, and may take
                minutes.
            on_stop: Called with the incomplete result if an exception, such as Ctrl-C, ends the run before that; not if
                `strict` ends it.

        Raises:
            InputError: No frames are selected, the data lack what a step requires, or `strict` is set and there is a
                problem.
        """
        source = source_of(dataset, frames)
        positions = source.positions or range(0)
        sweep = sweep_duration(dataset, recorded.stamps if recorded else None)
        angle = vertical_correction(self.config.front_end, source.sensor)
        about: Any = {"sweep_duration": sweep, "vertical_correction": angle}
        odometry = recorded.steps(positions, **about) if recorded else None
        front_end = self.make_front_end() if self.make_front_end else None
        about = {"source": source, "sweep_duration": sweep, "odometry": odometry, "strict": strict, "journal": journal}
        slam = Slam(self.config, front_end, **about, observer=observer)
        problems = (*dataset.problems, *(recorded.problems if recorded else ()))
        _raise_if_strict(problems, strict)
        done = len(slam.result.records)
        if not done:
            slam.result.problems.extend(problems)
        elif journal and journal.state and done <= len(positions):
            _require_same_scan(dataset, positions[done - 1], journal.state["run"]["last"])
        with slam:
            try:
                if on_frame:
                    for record in slam.result.records:
                        on_frame(record)
                left = positions[done:]
                for position, (frame, load) in zip(left, _read_ahead(dataset, left), strict=True):
                    record = slam.add(recorded.stamped(frame, position) if recorded else frame, load)
                    if on_frame:
                        on_frame(record)
            except BaseException as error:
                if on_stop and not isinstance(error, RefusedError):
                    on_stop(slam.result)
                raise
            slam.result.settle_truth()
            if on_odometry:
                on_odometry(slam.result)
            return slam.finish()


def _record_fields(step: OdometryStep) -> dict[str, Any]:
    """The fields of a record from the odometry's step."""
    return {
        "pose": step.pose,
        "covariance": step.covariance,
        "status": step.status,
        "inlier_ratio": step.registration.inlier_ratio if step.registration else float("nan"),
        "unobserved": step.unobserved,
    }


def source_of(dataset: Dataset, frames: slice = slice(None)) -> Source:
    """Return the source of a run: the selected frames of a data set.

    Raises:
        InputError: No frames are selected.
    """
    positions = chosen_positions(dataset, frames)
    truth = None if dataset.ground_truth is None else dataset.ground_truth[positions]
    true_positions: Array | None = getattr(dataset, "true_positions", None)
    return Source(
        dataset.name,
        dataset.path,
        dataset.sensor,
        dataset.calibration,
        positions,
        truth,
        {order: poses[positions] for order, poses in getattr(dataset, "truth_readings", {}).items()},
        getattr(dataset, "point_times", None),
        getattr(dataset, "stamps_from", None),
        getattr(dataset, "topics", {}),
        None if true_positions is None else true_positions[positions],
    )


def vertical_correction(settings: FrontEndSettings, sensor: Sensor | None) -> float:
    """Return the angle [rad] added to each elevation: that of the settings, else that of the sensor."""
    own = sensor.vertical_correction if sensor else 0.0
    angle = settings.vertical_correction_deg
    return own if angle is None else float(np.deg2rad(angle))


def sweep_duration(dataset: Dataset, stamps: Array | None = None) -> float:
    """Return the time [s] between successive scans: the usual step between the stamps.

    Args:
        dataset: The data set; its attribute `scan_period`, if it has one, is used before its stamps, since scans may be
            missing.
        stamps: Times (N,) [s] in place of those of the data set.
    """
    if stamps is not None:
        return usual_step(stamps) or SWEEP
    return float(getattr(dataset, "scan_period", None) or usual_step(dataset.stamps) or SWEEP)


def _check_times(frame: Frame, sweep: float) -> None:
    """Raise InputError if the points' times span many sweeps, and so cannot be seconds relative to the stamp."""
    time = frame.cloud.time
    if time is None or len(time) == 0:
        return
    first, last = float(time.min()), float(time.max())
    if not last - first <= MAX_SPAN * max(sweep, MIN_SWEEP):
        raise InputError(
            f"frame {frame.index}: the points' times span {last - first:.3g} s, and a sweep takes about {sweep:.2g} s; "
            "give times in seconds relative to the stamp, not fractions of the sweep or other units"
        )


class RefusedError(InputError):
    """The data have a problem, and `strict` is set."""


def _raise_if_strict(problems: Sequence[Problem], strict: bool) -> None:
    """Raise the first problem if `strict` is set."""
    if strict and problems:
        raise RefusedError(problems[0].message)


def _require_same_scan(dataset: Dataset, position: int, expected: int) -> None:
    """Raise InputError if a scan is not the one that an earlier part of the run registered."""
    if fingerprint(dataset[position].cloud) != expected:
        raise InputError(f"{dataset.path}: scan {position} has changed since the run began; run again without --resume")


def _read_ahead(dataset: Dataset, positions: range) -> Iterator[tuple[Frame, float]]:
    """Yield the frames in order, each with its read time [ms]; the next frame is read in the background."""

    def read(position: int) -> tuple[Frame, float]:
        begin = time.perf_counter()
        return dataset[position], 1e3 * (time.perf_counter() - begin)

    with ThreadPoolExecutor(1, "read-ahead") as reader:
        pending = deque(reader.submit(read, position) for position in positions[:1])
        for position in (*positions[1:], *(None for _ in positions[:1])):
            frame = pending.popleft().result()
            if position is not None:
                pending.append(reader.submit(read, position))
            yield frame
