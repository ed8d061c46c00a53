"""What a run gives: a record a frame, the trajectory before and after loops, the map, and where the scans came from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from slam import degeneracy
from slam.cell_sizes import Sizes
from slam.data import se3
from slam.data.cloud import Array, Calibration, PointCloud
from slam.data.ground_truth import UNSETTLED, GroundTruth, settled_truth
from slam.data.point_times import PointTimes
from slam.data.problem import Problem
from slam.data.sensor import Sensor
from slam.mapper import MappingResult
from slam.settings import Config

STAGES = (
    "load",
    "front_end",
    "odometry",
    "waiting",
)  # of a frame, the last for the mapper, which has stages of its own


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """The odometry's answer for one frame.

    Attributes:
        index: The frame's number in its data set; in a live run its place, from 0.
        stamp: Seconds.
        pose: (4, 4) T_world_lidar; the world is the first scan's frame.
        covariance: (6, 6) of the motion since the scan before, as in `OdometryStep`.
        status: 'registered', 'retried', 'degenerate' or 'failed', as in `OdometryStep`.
        inlier_ratio: Share of the matched points that fit the map, 0..1; NaN where nothing was registered.
        points: How many points the front end handed to the odometry.
        milliseconds: By the stages `STAGES`.
        unobserved: (K, 6) unit vectors (rotation, translation) in the sensor's axes, along which a degenerate scan did
            not hold the pose: there it is the prediction's. Of any other scan (0, 6).
    """

    index: int
    stamp: float
    pose: Array
    covariance: Array
    status: str
    inlier_ratio: float
    points: int
    milliseconds: dict[str, float]
    unobserved: Array = field(default_factory=lambda: np.zeros((0, 6)))


@dataclass(frozen=True, eq=False)
class Source:
    """Where a run's scans come from.

    Attributes:
        name: For tables and run.json, like 'KITTI odometry 04'.
        path: The data set's folder, None in a live run.
        sensor: The LiDAR's laser lines, None where they are unknown.
        calibration: The camera beside the LiDAR, None without one.
        positions: Which frames of the data set are run, None in a live run.
        ground_truth: (N, 4, 4) T_world_lidar of these frames, NaN where unknown, or None.
        truth_readings: Of `GroundTruth`, of these frames.
        point_times: The verdict on the times of the drive's points, None where nobody gave one.
        stamps_from: Where the scans' stamps are from, None where nobody said.
    """

    name: str = "live"
    path: Path | None = None
    sensor: Sensor | None = None
    calibration: Calibration | None = None
    positions: range | None = None
    ground_truth: Array | None = None
    truth_readings: Mapping[str, Array] = field(default_factory=dict)
    point_times: PointTimes | None = None
    stamps_from: str | None = None


@dataclass(eq=False)
class Run:
    """A run over a drive, complete once `mapping` is there.

    Attributes:
        source: Where the scans came from.
        config: The settings.
        vertical_correction: Angle [rad] that every elevation was raised by.
        timed: How many scans had points with times, and were deskewed.
        sizes: Of the odometry's cells and thinning, from the settings or the first scan; None where poses are recorded.
        mapping: Keyframes, loops and map, None while frames are still being added.
        milliseconds: Of the stages behind the odometry (map, loops, back_end), a figure a keyframe or frame.
        records: One a frame.
        problems: What was wrong with the data.
    """

    source: Source
    config: Config
    vertical_correction: float
    timed: int = 0
    sizes: Sizes | None = None
    mapping: MappingResult | None = None
    milliseconds: dict[str, list[float]] = field(default_factory=dict)
    records: list[FrameRecord] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)

    @property
    def odometry_poses(self) -> Array:
        """(N, 4, 4) T_world_lidar before loops, the first identity."""
        return np.array([record.pose for record in self.records]).reshape(-1, 4, 4)

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
        return self.source.ground_truth

    def settle_truth(self) -> None:
        """Hold the truth against the odometry, once that is there: see `settled_truth`."""
        said = tuple(problem for problem in self.problems if problem.kind in UNSETTLED)
        source = self.source
        truth = settled_truth(GroundTruth(source.ground_truth, source.truth_readings, said), self.odometry_poses)
        self.source = replace(source, ground_truth=truth.poses, truth_readings={})
        self.problems = [problem for problem in self.problems if problem.kind not in UNSETTLED]
        self.problems.extend(truth.problems)

    @property
    def deskewed(self) -> bool:
        """Whether any scan was."""
        return self.timed > 0

    def times(self) -> str:
        """What the points' times were taken for, in one line."""
        frames = len(self.records)
        if self.config.front_end.deskew is False:
            return "point times: not used (front_end.deskew is false)"
        if self.source.point_times is None:
            return f"point times: seconds from the stamp, as given, in {self.timed} of {frames} scans"
        return self.source.point_times.verdict(self.timed, frames)

    def counts(self) -> dict[str, int]:
        """Frames by their status, and problems by their kind."""
        statuses = Counter(record.status for record in self.records)
        kinds = Counter(problem.kind for problem in self.problems)
        known = {name: statuses[name] for name in ("registered", "retried", "degenerate", "failed")}
        return {"frames": len(self.records), **known, **{kind.replace(" ", "_"): n for kind, n in kinds.items()}}

    def notes(self) -> list[str]:
        """What whoever reads the results should know, a sentence each."""
        poses, found = self.odometry_poses, []
        for number, record in enumerate(self.records):
            if record.status == "degenerate":
                motion = (se3.inverse(poses[number]) @ poses[max(number - 1, 0)])[:3, 3]
                found.append(degeneracy.directions(record.unobserved, motion))
        return [degeneracy.sentence(found, len(self.records))] if found else []
