"""SLAM frame by frame, live or over a data set: the line that everything else hangs on."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import numpy as np

from slam.data.cloud import Array, Frame, PointCloud
from slam.data.dataset import Dataset, chosen_positions
from slam.data.errors import InputError
from slam.data.images import ImageFile
from slam.data.problem import Problem
from slam.data.sensor import Sensor
from slam.data.stamps import stamp_problems, usual_step
from slam.data.world_frame import centre, world_frame_problem
from slam.front_end import FrontEnd, RingFrontEnd
from slam.mapper import Mapper
from slam.mid_sweep import MidSweepOdometry
from slam.odometry import Odometry, OdometryStep
from slam.recorded_odometry import RecordedOdometry
from slam.run import FrameRecord, Run, Source
from slam.settings import Config, FrontEndSettings
from slam.tracking import PoseSource, Tracker

SWEEP = 0.1  # s; spinning LiDARs turn ten times a second
LEAST_SWEEP = 0.04  # s; hardly one turns faster
LONGEST_SPAN = 5.0  # sweeps that a scan's points may be apart


class Slam:
    """LiDAR SLAM, one frame after the other.

    Each frame passes the front end and the odometry at once; keyframes, loop closures and the pose graph follow in a
    thread of their own. Results repeat bit for bit: they depend on the frames, never on the timing.

    Use it in a `with` statement, so that an exception stops the thread.

    Args:
        config: The settings; by default `Config()`.
        front_end: Makes the cloud that is registered, of this run alone; by default the rings that `config` asks for.
        source: Where the frames come from, for the run folder.
        sweep_duration: Seconds from scan to scan, where none is missing.
        odometry: What gives the poses; by default our odometry with the settings of `config`.
        strict: Stop at the first problem of a frame.

    Raises:
        InputError: `config` asks for rings that the sensor does not have.
        ValueError: `config` asks for enriched input and no front end that enriches is given.
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
    ) -> None:
        config, source = config or Config(), source or Source()
        if front_end is None and config.front_end.input == "enriched":
            raise ValueError(
                "input 'enriched' needs a front end that enriches: lidarlift.run and lidarlift.Slam have it"
            )
        angle = vertical_correction(config.front_end, source.sensor)
        self.result = Run(source, config, angle)
        self._tracker = Tracker(
            front_end or RingFrontEnd(config.front_end, source.sensor),
            odometry
            or MidSweepOdometry(Odometry(config.odometry, sweep_duration=sweep_duration, vertical_correction=angle)),
            config.front_end.deskew,
        )
        self._mapper = Mapper(config)
        self._waiting: list[tuple[int, Frame, PointCloud]] = []  # whose poses are provisional, with their positions
        self._images: list[ImageFile] = []  # that seemed sound, and may turn out to be damaged when they are read
        self._centres: list[Array] = []
        self._sweep_duration, self._strict = sweep_duration, strict

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._mapper.__exit__(kind, value, trace)

    def add(self, frame: Frame, load_milliseconds: float = 0.0) -> FrameRecord:
        """Register the next frame.

        Args:
            frame: Points as recorded, in the sensor's frame, with their stamp, and the image beside them. The pose is
                that of the sensor at the stamp; the points' times count from there, in seconds.
            load_milliseconds: How long reading it took, for the timings.

        Returns:
            Pose, covariance and status at once, before any loop that this frame may close. At the beginning of a drive
            they may be put right a few frames later, in `result.records`.

        Raises:
            InputError: The stamp is no number; the points' times are no seconds; deskewing was asked for and the points
                have no times; or `strict` met a problem.
            ValueError: `finish` was called before.
        """
        if self.result.mapping:
            raise ValueError("this run is finished; begin another one")
        if not np.isfinite(frame.stamp):
            raise InputError(f"frame {frame.index}: its stamp is {frame.stamp}; give the scan's time in seconds")
        _check_times(frame, self._sweep_duration)
        before = self.result.records[-1] if self.result.records else None
        problems = (*frame.problems, *stamp_problems(frame, before, self._sweep_duration))
        _refuse(problems, self._strict)
        self.result.problems.extend(problems)
        images = [reader for reader in frame.image_readers if isinstance(reader, ImageFile)]
        unread = [image for image in images if image.problem is None]  # of others, the frame's problems tell
        self._centres.append(centre(frame.cloud.xyz))
        tracked = self._tracker(frame)
        self._images.extend(unread)
        self._note_images(unread)
        self.result.timed += tracked.timed
        self.result.sizes = self._tracker.sizes

        step, position = tracked.step, len(self.result.records)
        laps = {"load": load_milliseconds, **tracked.milliseconds}
        points = len(tracked.cloud)
        self.result.records.append(
            FrameRecord(frame.index, frame.stamp, **_answer(step), points=points, milliseconds=laps)
        )
        self._waiting.append((position, frame, tracked.cloud))
        begin = time.perf_counter()
        if not step.provisional:
            self._hand_on((*step.revised, step))
        laps["waiting"] = 1e3 * (time.perf_counter() - begin)
        return self.result.records[-1]

    def _hand_on(self, steps: tuple[OdometryStep, ...]) -> None:
        """The frames that waited go to the mapper, and into the records, as their poses are now known to be."""
        for (position, frame, cloud), step in zip(self._waiting, steps, strict=True):
            self.result.records[position] = replace(self.result.records[position], **_answer(step))
            self._mapper.add(position, frame, cloud, step)
        self._waiting.clear()

    def trajectory(self) -> Array:
        """(N, 4, 4) T_world_lidar of all frames so far, by the loops that are closed so far; the first is the identity.

        Waits until the keyframes so far are searched for loops: a few frames' time. Nothing later changes by asking.
        """
        return self.result.poses if self.result.mapping else self._mapper.corrected(self.result.odometry_poses)

    def finish(self) -> Run:
        """Search the last keyframes for loops, judge all loops together, and build the map."""
        if self.result.mapping is None:
            self._hand_on(self._tracker.settle())
            self.result.mapping, self.result.milliseconds = self._mapper.finish(), self._mapper.milliseconds
            self._mapper.close()
            self._note_images(self._images)
            self.result.problems.extend(world_frame_problem(np.array(self._centres), self.result.odometry_poses))
        return self.result

    def _note_images(self, images: Sequence[ImageFile]) -> None:
        """What reading showed of images that seemed sound is a problem of the run, once."""
        problems = [image.problem for image in images if image.problem]
        if problems:
            self._images = [image for image in self._images if image.problem not in problems]
        _refuse(problems, self._strict)
        self.result.problems.extend(problems)


class Pipeline:
    """Runs a configuration over data sets, as often as one likes: nothing outlives a run.

    `make_front_end` makes the front end of each run, in place of the rings that the configuration asks for; a front end
    may learn from the scans that it is shown.
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
        on_frame: Callable[[FrameRecord], None] | None = None,
        on_odometry: Callable[[Run], None] | None = None,
        on_stop: Callable[[Run], None] | None = None,
    ) -> Run:
        """Feed the frames of a data set to `Slam`.

        Args:
            dataset: The drive.
            frames: Positions in the data set, as in a list's slice.
            recorded: Poses of another odometry, which take the place of ours.
            strict: Stop at the first problem of the data.
            on_frame: Called after each frame.
            on_odometry: Called when all frames are registered. Judging the loops and building the map follow, and may
                take minutes.
            on_stop: Called with what is known where an exception, Ctrl-C among them, ends the run before that; not
                where `strict` does, which asks for all or nothing.

        Raises:
            InputError: No frames are left, a step asks for what the data do not have, or `strict` met a problem.
        """
        source = source_of(dataset, frames)
        positions = source.positions or range(0)
        sweep = sweep_duration(dataset, recorded.stamps if recorded else None)
        angle = vertical_correction(self.config.front_end, source.sensor)
        about: Any = {"sweep_duration": sweep, "vertical_correction": angle}
        odometry = recorded.steps(positions, **about) if recorded else None
        front_end = self.make_front_end() if self.make_front_end else None
        slam = Slam(self.config, front_end, source=source, sweep_duration=sweep, odometry=odometry, strict=strict)
        problems = (*dataset.problems, *(recorded.problems if recorded else ()))
        _refuse(problems, strict)
        slam.result.problems.extend(problems)
        with slam:
            try:
                for position, (frame, load) in zip(positions, _read_ahead(dataset, positions), strict=True):
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


def _answer(step: OdometryStep) -> dict[str, Any]:
    """What a record has of the odometry's step."""
    return {
        "pose": step.pose,
        "covariance": step.covariance,
        "status": step.status,
        "inlier_ratio": step.registration.inlier_ratio if step.registration else float("nan"),
        "unobserved": step.unobserved,
    }


def source_of(dataset: Dataset, frames: slice = slice(None)) -> Source:
    """The frames of a data set as the source of a run. Raises InputError where none are left."""
    positions = chosen_positions(dataset, frames)
    truth = None if dataset.ground_truth is None else dataset.ground_truth[positions]
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
    )


def vertical_correction(settings: FrontEndSettings, sensor: Sensor | None) -> float:
    """Angle [rad] that every elevation is raised by: the settings', else the sensor's own."""
    own = sensor.vertical_correction if sensor else 0.0
    angle = settings.vertical_correction_deg
    return own if angle is None else float(np.deg2rad(angle))


def sweep_duration(dataset: Dataset, stamps: Array | None = None) -> float:
    """Seconds from scan to scan, where none is missing: the usual step between the stamps.

    `stamps` (N,) [s] take the place of the data set's own. Of a drive with scans missing, a data set may know better
    (`scan_period`).
    """
    if stamps is not None:
        return usual_step(stamps) or SWEEP
    return float(getattr(dataset, "scan_period", None) or usual_step(dataset.stamps) or SWEEP)


def _check_times(frame: Frame, sweep: float) -> None:
    """Raise InputError where points' times cannot be seconds from the stamp: they would span many sweeps."""
    time = frame.cloud.time
    if time is None or len(time) == 0:
        return
    first, last = float(time.min()), float(time.max())
    if not last - first <= LONGEST_SPAN * max(sweep, LEAST_SWEEP):
        raise InputError(
            f"frame {frame.index}: its points' times span {last - first:.3g} s, where a sweep takes about {sweep:.2g}; "
            "give seconds from the scan's stamp, neither fractions of the sweep nor other units"
        )


class RefusedError(InputError):
    """The data have a problem, and the caller asked to stop at the first."""


def _refuse(problems: Sequence[Problem], strict: bool) -> None:
    if strict and problems:
        raise RefusedError(problems[0].message)


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
