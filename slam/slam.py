"""SLAM frame by frame, live or fed from a data set."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import numpy as np

from slam.data.cloud import Array, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.problem import Problem
from slam.data.scan_size import size_problem, thinned
from slam.data.stamps import stamp_problems
from slam.data.world_frame import centre, world_frame_problem
from slam.front_end import FrontEnd, RingFrontEnd
from slam.journal.journal import Journal
from slam.mapper import Mapper
from slam.mid_sweep import MidSweepOdometry
from slam.odometry import Odometry, OdometryStep
from slam.records import FrameRecord
from slam.refusal import check_times, raise_if_strict
from slam.run import Observer, Run, Source
from slam.run_record import Progress, RunRecord
from slam.settings import Config
from slam.source import SWEEP, vertical_correction
from slam.tracking import PoseSource, Tracked, Tracker


class Slam:
    """LiDAR SLAM, one frame after the other.

    Front end and odometry process each frame immediately; keyframes, loop closures and the pose graph follow in
    separate threads. Results are deterministic, bit for bit: they depend on the frames, not on the timing.

    Use it in a `with` statement, so that an exception stops the threads. One thread at a time adds frames.

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
        about: Any = {"sweep_duration": sweep_duration, "vertical_correction": angle}
        self.result = Run(source, config, angle)
        self._tracker = Tracker(
            front_end or RingFrontEnd(config.front_end, source.sensor),
            odometry or MidSweepOdometry(Odometry(config.odometry, **about)),
            config.front_end.deskew,
        )
        self._mapper = Mapper(config, observer.loops_closed if observer else None, journal)
        self._observer, self._sweep_duration, self._strict = observer, sweep_duration, strict
        if observer:
            observer.started(self.result)
        self._waiting: list[tuple[int, Frame, PointCloud]] = []  # with provisional poses; their positions
        self._progress = Progress(self.result, self._tracker, self._mapper)
        self._record = RunRecord(journal, self._progress) if journal else None
        self._busy = threading.Lock()
        self._ended = False  # whether the last frame is passed to the mapper

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
        self._check(frame)
        images = self._progress.images.watch(frame)
        self._progress.centres.append(centre(frame.cloud.xyz))
        tracked = self._tracker(thinned(frame))
        self._report(self._progress.images.found(images))
        self.result.timed += tracked.timed
        self.result.sizes = self._tracker.sizes

        laps = {"load": load_milliseconds, **tracked.milliseconds, "waiting": 0.0}
        self._waiting.append((len(self.result.records), frame, tracked.cloud))
        self.result.records.append(_record(frame, tracked, laps))
        begin, step = time.perf_counter(), tracked.step
        if not step.provisional:
            self._pass_to_mapper((*step.revised, step))
        record, laps["waiting"] = self.result.records[-1], 1e3 * (time.perf_counter() - begin)
        self.result.records[-1] = record = replace(record, milliseconds=laps)
        if self._record and not self._waiting:
            self._record.add(frame)
        if self._observer:
            self._observer.registered(frame, step.cloud, record)
        return record

    def _check(self, frame: Frame) -> None:
        """Refuse what cannot be registered, and report the problems of a frame."""
        if self._ended:
            raise ValueError("the run is finished; create another Slam")
        self._mapper.check()
        if not np.isfinite(frame.stamp):
            raise InputError(f"frame {frame.index}: the stamp is {frame.stamp}; give the scan's time in seconds")
        check_times(frame, self._sweep_duration)
        before = self.result.records[-1] if self.result.records else None
        self._report((*frame.problems, *size_problem(frame), *stamp_problems(frame, before, self._sweep_duration)))

    def _report(self, problems: Sequence[Problem]) -> None:
        """Add problems to the run, or raise the first one if the run is strict."""
        raise_if_strict(problems, self._strict)
        self.result.problems.extend(problems)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Refuse a second thread: the result would depend on which one is first."""
        if not self._busy.acquire(blocking=False):
            raise RuntimeError("Slam is in use by another thread; add frames from one thread, in their order")
        try:
            yield
        finally:
            self._busy.release()

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
        """Close the last loops, select the consistent loops jointly, and build the map; return the result.

        After an exception, as where the memory does not suffice for the map, it can be called again and does what is
        left. The exception of an earlier frame is raised again; the session, if there is one, can be resumed.
        """
        with self._alone():
            if self.result.mapping is None:
                self._end()
                mapping = self._mapper.finish()
                self._report(self._progress.images.rest())
                centres = self._progress.centres.array()
                self.result.problems.extend(world_frame_problem(centres, self.result.odometry_poses))
                self.result.mapping, self.result.milliseconds = mapping, self._mapper.milliseconds
                self._mapper.close()
                if self._observer:
                    self._observer.finished(self.result)
            return self.result

    def _end(self) -> None:
        """Pass the last frames to the mapper, and free the local map; no frame follows."""
        if not self._ended:
            self._pass_to_mapper(self._tracker.settle())
            if self._record:
                self._record.write_frames()
            self._tracker.release()  # the map is built in its memory
            self._ended = True


def _record(frame: Frame, tracked: Tracked, milliseconds: dict[str, float]) -> FrameRecord:
    """The record of a frame; the run times may still be completed."""
    fields = _record_fields(tracked.step)
    return FrameRecord(frame.index, frame.stamp, **fields, points=len(tracked.cloud), milliseconds=milliseconds)


def _record_fields(step: OdometryStep) -> dict[str, Any]:
    """The fields of a record from the odometry's step."""
    return {
        "pose": step.pose,
        "covariance": step.covariance,
        "status": step.status,
        "inlier_ratio": step.registration.inlier_ratio if step.registration else float("nan"),
        "unobserved": step.unobserved,
    }
