"""Result of a run: a record per frame, the trajectory before and after loop closure, the map, and the data source."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from slam import degeneracy
from slam.cell_sizes import Sizes
from slam.data import se3
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.ground_truth import UNSETTLED, GroundTruth, settled_truth
from slam.data.point_times import PointTimes
from slam.data.problem import Problem
from slam.data.sensor import Sensor
from slam.gathering import drift_per_metre
from slam.graph.drift import MotionErrors, accumulating, map_errors
from slam.graph.pose_graph import PoseGraph
from slam.graph.uncertainty import frame_covariances
from slam.mapping_result import LoopProgress, MappingResult
from slam.records import FrameRecord, Records
from slam.segments import GAP_COVARIANCE, segment_starts, unjoined
from slam.settings import Config


class Observer(Protocol):
    """Watches a run, to show or record it. It changes nothing of what it is given, and returns soon."""

    def started(self, run: Run) -> None:
        """Take the run at its beginning; its records and problems grow."""
        ...

    def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
        """Take a frame when its pose is known.

        Args:
            frame: The frame as recorded, with its images. Reading these through it may add problems to the run.
            cloud: The cloud as registered: enriched, deskewed, in the sensor's frame.
            record: Pose and status. The poses of the first frames may be revised later, in the run's records.
        """
        ...

    def loops_closed(self, progress: LoopProgress) -> None:
        """Take the poses after loops were closed; called in the mapper's thread."""
        ...

    def finished(self, run: Run) -> None:
        """Take the complete run, with the selected loops and the map."""
        ...


@dataclass(frozen=True, eq=False)
class Source:
    """Source of the scans of a run.

    Attributes:
        name: Name for tables and run.json, such as 'KITTI odometry 04'.
        path: The data set's folder, None in a live run.
        sensor: The LiDAR's laser lines, None if unknown.
        calibration: Calibration of the camera, None without one.
        positions: Positions of the frames in the data set, None in a live run.
        ground_truth: (N, 4, 4) T_world_lidar of these frames, NaN where unknown, or None.
        truth_readings: As in `GroundTruth`, of these frames.
        point_times: The verdict on the point times of the data set, None without one.
        stamps_from: Source of the scans' stamps, None if unknown.
        true_positions: (N, 3) [m] positions of the LiDAR at these frames, NaN where unknown, if the ground truth has no
            rotations; or None.
        topics: Topics of a recording that are used, by 'points', 'images' and 'truth'.
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
    topics: Mapping[str, str] = field(default_factory=dict)
    true_positions: Array | None = None


@dataclass(eq=False)
class Run:
    """A run over a sequence, complete when `mapping` is set.

    Attributes:
        source: Source of the scans.
        config: The settings.
        vertical_correction: Angle [rad] that was added to every elevation.
        timed: Number of scans whose points had times and were deskewed.
        sizes: Cell and voxel sizes of the odometry, from the settings or the first scan; None with recorded poses.
        mapping: Keyframes, loops and map, None while frames are added.
        milliseconds: Run times of the mapper's stages (map, loops, back_end), one figure per keyframe or frame.
        records: One record per frame.
        problems: Problems in the data.
        remarks: Notes about the input, such as where one enrichment method replaces another.
    """

    source: Source
    config: Config
    vertical_correction: float
    timed: int = 0
    sizes: Sizes | None = None
    mapping: MappingResult | None = None
    milliseconds: dict[str, Array] = field(default_factory=dict)
    records: Records = field(default_factory=Records)
    problems: list[Problem] = field(default_factory=list)
    remarks: tuple[str, ...] = ()

    @property
    def odometry_poses(self) -> Array:
        """Poses (N, 4, 4) T_world_lidar before loop closure; the first is the identity."""
        return self.records.poses

    @property
    def poses(self) -> Array:
        """Poses (N, 4, 4) T_world_lidar after loop closure; the first is the identity."""
        return self.mapping.corrected(self.odometry_poses) if self.mapping else self.odometry_poses

    def covariances(self) -> Array:
        """Compute the covariances (N, 6, 6) of `poses` relative to the first one, which is exact.

        The true pose is pose @ exp(xi), xi = (rotation [rad], translation [m]) in the sensor's axes at the pose. They
        are those of each registration, of the drift of the local map, and of the accepted loops. Takes about 0.3 ms per
        frame.
        """
        poses, keyframes = self.poses, self.mapping.keyframes.indices if self.mapping else np.zeros(0, int)
        graph = self.mapping.graph if self.mapping else PoseGraph(np.zeros((0, 4, 4)), ())
        motions = max(len(keyframes) - 1, 0)
        places = segment_starts(graph.edges[:motions])
        starts = keyframes[places].tolist()
        errors = self._motion_errors(starts)
        errors.drift[starts] = GAP_COVARIANCE
        known = set(self.mapping.known.tolist()) if self.mapping else set()
        covariances = frame_covariances(poses, errors, keyframes, graph, known)
        for segment in unjoined(places, graph.edges[motions:]):
            begin, end = starts[segment - 1], [*starts, len(poses)][segment]
            for frame in range(begin, end):
                Ad = se3.adjoint(se3.inverse(poses[frame]) @ poses[begin])
                covariances[frame] += Ad @ GAP_COVARIANCE @ Ad.T
        return covariances

    def _motion_errors(self, starts: Sequence[int]) -> MotionErrors:
        """Errors of the odometry, whose local maps began at the first frame and at `starts`."""
        poses = self.odometry_poses
        covariances, statuses = self.records.covariances, self.records.statuses
        if self.sizes is not None and self.config.odometry.target == "map":
            failed = np.array([status == "failed" for status in statuses], bool)
            return map_errors(poses, covariances, self.records.unobserved, failed, starts)
        travelled = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0, prepend=poses[:1, :3, 3]), axis=1)
        return accumulating(covariances + travelled[:, None, None] * drift_per_metre(self.config.pose_graph))

    @property
    def map(self) -> PointCloud:
        """Global map in the world frame."""
        return self.mapping.map if self.mapping else PointCloud(np.zeros((0, 3)), np.zeros(0))

    @property
    def stamps(self) -> Array:
        """Stamps (N,) [s]."""
        return self.records.stamps

    @property
    def ground_truth(self) -> Array | None:
        """True poses (N, 4, 4) T_world_lidar of the same frames, NaN where unknown, or None."""
        return self.source.ground_truth

    def loops(self) -> list[tuple[int, int]]:
        """Return the accepted loops, as the positions of their two frames in the run, the earlier one first."""
        if self.mapping is None:
            return []
        indices = self.mapping.keyframes.indices
        accepted = [record.candidate for record in self.mapping.ledger if record.status == "accepted"]
        return [(int(indices[candidate.i]), int(indices[candidate.j])) for candidate in accepted]

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
        """Describe the interpretation of the points' times in one line."""
        frames = len(self.records)
        if self.config.front_end.deskew is False:
            return "point times: not used (front_end.deskew is false)"
        if self.source.point_times is None:
            return f"point times: seconds from the stamp, as given, in {self.timed} of {frames} scans"
        return self.source.point_times.verdict(self.timed, frames)

    def counts(self) -> dict[str, int]:
        """Count frames by status, and problems by kind."""
        statuses = Counter(self.records.statuses)
        kinds = Counter(problem.kind for problem in self.problems)
        known = {name: statuses[name] for name in ("registered", "retried", "degenerate", "failed")}
        return {"frames": len(self.records), **known, **{kind.replace(" ", "_"): n for kind, n in kinds.items()}}

    def notes(self) -> list[str]:
        """Return notes for the reader of the results, one sentence each."""
        poses, found = self.odometry_poses, []
        directions, frames = self.records.unobserved, self.records.indices
        for number, status in enumerate(self.records.statuses):
            if status == "degenerate":
                motion = (se3.inverse(poses[number]) @ poses[max(number - 1, 0)])[:3, 3]
                found.append(degeneracy.directions(directions[number], motion))
        segments = self.mapping.segments_note(frames) if self.mapping else ""
        degenerate = degeneracy.summary(found, len(self.records)) if found else ""
        return [*self.remarks, *(note for note in (segments, degenerate) if note)]
