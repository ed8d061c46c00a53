"""SLAM on a live LiDAR, scan by scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from lidarlift.front_ends import front_end_for, front_end_notes, settings_for
from lidarlift.live_folder import LiveFolder
from slam import slam
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.point_files import points_of
from slam.data.scan_columns import Columns, find_columns
from slam.data.sensor import load_sensor
from slam.identity import live_identity
from slam.records import FrameRecord
from slam.run import Observer, Run, Source
from slam.settings import Config

NAME, EMPTY = "live", PointCloud(np.zeros((0, 3)), np.zeros(0))
UNKNOWN = Columns()  # before the first scan with points


class Slam:
    """LiDAR SLAM that is given one scan at a time.

    Pose, covariance and status of a scan are returned at once. Keyframes, loop closures and the pose graph are
    processed in other threads; `trajectory` returns their current estimate, `finish` selects the consistent loop
    closures and builds the map. `lidarlift.run` feeds the same object from a data set.

    Use it in a `with` statement, so that an exception stops the threads.

    Args:
        sensor: A built-in LiDAR ('hdl64', 'vlp16', 'vlp32c', ...) or a YAML file with its beams. Required for input
            'enriched'.
        input: 'full', scans as received; '16' or another number, rings dropped; 'enriched', 16 of 64 rings, or all
            rings of a sparser LiDAR, enriched to about 64. By default as received.
        enricher: The enrichment method: 'ray-segment' takes some milliseconds and needs no camera.
        calibration: Calibration of the camera, if images are added: they colour the map, and methods may use them.
        config: A preset's name, a YAML file, or the result of `load_config`.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.
        sweeps_per_second: Rotation rate of the LiDAR [Hz].
        out: The run folder. All that the run finds out is written there at once, into a session: after a crash or a
            power loss `lidarlift export` has the trajectory and the map so far. `finish` writes the results.
        resume: Continue the session in `out` from its last snapshot, which is up to 10 s old; without one, begin. The
            next scan is the one after `scans`: if scans are gone, this is a gap, as when a recording misses some.
        observer: Watches the run frame by frame, see `slam.run.Observer`.

    Raises:
        InputError: The sensor does not have the rings for this input, or a setting is invalid; or `out` cannot be
            written, or holds an unfinished run that is not resumed or that began with something else.
        ValueError: `resume` without `out`.

    Example:
        >>> with lidarlift.Slam(sensor="vlp16", input="enriched", enricher="ray-segment", out="runs/live") as slam:
        ...     for stamp, points in scans:  # (N, 4) x y z intensity, metres
        ...         step = slam.add(points, stamp)
        ...         print(step.status, step.pose[:3, 3])
        ...     run = slam.finish()  # and the run folder is written
    """

    def __init__(
        self,
        sensor: str | Path | None = None,
        *,
        input: str | None = None,
        enricher: str | None = None,
        calibration: Calibration | None = None,
        config: Config | str | Path | None = None,
        overrides: Sequence[str] = (),
        sweeps_per_second: float = 10.0,
        out: str | Path | None = None,
        resume: bool = False,
        observer: Observer | None = None,
    ) -> None:
        if not sweeps_per_second > 0:
            raise InputError(
                f"sweeps_per_second: {sweeps_per_second} is not positive; spinning LiDARs turn at 5 to 20 Hz"
            )
        self._sensor = None if sensor is None else load_sensor(sensor)
        settings = settings_for(
            None if self._sensor is None else self._sensor.ring_count, input, enricher, config, overrides
        )
        if resume and out is None:
            raise ValueError("resume continues the run in `out`; give both")
        front_end = front_end_for(settings.front_end, self._sensor, NAME)
        source = Source(NAME, sensor=self._sensor, calibration=calibration)
        about: Any = {"source": source, "sweep_duration": 1 / sweeps_per_second}
        self._folder = None if out is None else LiveFolder(Path(out), live_identity(**about, config=settings), resume)
        try:
            journal = self._folder.journal if self._folder else None
            self._slam = slam.Slam(settings, front_end, **about, journal=journal, observer=observer)
        except BaseException:
            self._release()
            raise
        self._slam.result.remarks = front_end_notes(settings.front_end, self._sensor)
        self._period, self._columns = 1 / sweeps_per_second, UNKNOWN

    def __enter__(self) -> Self:
        self._slam.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._slam.__exit__(kind, value, trace)
        self._release()

    def _release(self) -> None:
        if self._folder:
            self._folder.close()
            self._folder = None

    @property
    def scans(self) -> int:
        """Number of scans so far, also of those before the run was resumed."""
        return len(self._slam.result.records)

    def add(self, points: Array | PointCloud, stamp: float, image: Array | None = None) -> FrameRecord:
        """Register the next scan.

        Args:
            points: Points in the sensor frame (x forward, y left, z up), metres: (N, 3) x y z, (N, 4) with intensity,
                or a structured array from a driver with the fields x, y, z and optionally intensity, ring and time.
                The unit of time, and whether it is relative to the stamp, is found from the first scan with points.
                Without a ring field, rings are derived from the sensor's laser lines. Or a `PointCloud`, with times in
                seconds from the stamp.
            stamp: Time of the instant of the sweep from which point times count (start, middle or end) [s]; the pose
                is that of the sensor at this instant. Points without times are treated as simultaneous. A stamp that
                does not increase, or jumps, is counted as a problem of the run that `finish` returns.
            image: (H, W, 3) uint8 RGB image of the calibrated camera, nearest in time, or None.

        Returns:
            Pose (4, 4) T_world_lidar, covariance and status, before any loop closure of this scan. If the status is
            'degenerate', `unobserved` holds the directions in which the scan did not constrain the pose.

        Raises:
            InputError: The points have another shape, lack fields, have rings that the sensor does not have, or times
                that are not seconds; or the stamp is not a finite number; or the run folder cannot be written.
        """
        place = self.scans
        name = Path(f"scan {place}")
        frame = Frame(place, float(stamp), EMPTY, self._slam.result.source.calibration, lambda: image)
        if isinstance(points, PointCloud):
            return self._slam.add(replace(frame, cloud=points))
        found = points_of(np.asarray(points), name)
        if self._columns is UNKNOWN and len(found.xyz):
            self._columns = find_columns([(found, frame.stamp)], self._sensor, None, self._period, name)
            known = self._slam.result.problems  # of a run that is resumed, which has found them before
            known.extend(problem for problem in self._columns.problems if problem not in known)
            source = self._slam.result.source
            self._slam.result.source = replace(source, point_times=self._columns.times, stamps_from="given")
        cloud, odd = self._columns.cloud(found, frame.stamp, name)
        return self._slam.add(replace(frame, cloud=cloud, problems=found.problems + odd))

    def trajectory(self) -> Array:
        """Return the poses (N, 4, 4) T_world_lidar of all scans so far, with the loops closed so far.

        The first pose is the identity. The call waits until the loop search has processed all keyframes so far, about
        the time of a few scans. It does not change later results.
        """
        return self._slam.trajectory()

    def finish(self) -> Run:
        """Select the consistent loop closures, optimise the pose graph, build the map, and write the run folder.

        Returns:
            The run, as returned by `lidarlift.run`; without `out`, `save_run` writes it into a run folder.

        Raises:
            InputError: The run folder cannot be written.
        """
        run = self._slam.finish()
        if self._folder:
            self._folder.save(run)
            self._folder = None
        return run
