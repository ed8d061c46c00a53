"""Mapping thread: keyframes, loop closure, pose graph and map from the registered scans."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import TracebackType
from typing import Any, Self

import numpy as np

from slam.data import se3
from slam.data.camera import with_colours
from slam.data.cloud import Array, Frame, PointCloud
from slam.graph.back_end import BackEnd
from slam.graph.ledger import LoopRecord
from slam.graph.pose_graph import PoseGraph
from slam.journal.journal import Journal
from slam.journal.state import freeze
from slam.loops.closing import LoopSearch
from slam.mapping.global_map import build_map
from slam.mapping.keyframes import Keyframe, Keyframes
from slam.mapping_record import MappingRecord, add_edges, kept_keyframes, places
from slam.odometry import OdometryStep
from slam.segments import GAP_COVARIANCE, SEGMENT_DISTANCE, segment_starts, segments_note, unjoined
from slam.settings import Config, PoseGraphSettings

MIN_TRAVELLED = 0.5  # m, lower bound of the distance in the drift model: a vehicle may turn on the spot
MAX_QUEUED_SCANS = 20  # the odometry blocks when mapping is this many scans behind: bounds the memory
STAGES = ("map", "loops", "back_end")
STATE = ("milliseconds", "_travelled", "_last", "_covariance", "_motion", "_lost")  # attributes in a snapshot


@dataclass(frozen=True, eq=False)
class MappingResult:
    """Result of mapping.

    Attributes:
        poses: (K, 4, 4) T_world_keyframe, optimised.
        keyframes: The keyframes, with odometry poses and clouds.
        ledger: Records of all loop candidates.
        graph: Optimised poses, odometry edges and accepted loop edges.
        map: Map from the optimised poses, without moving objects.
    """

    poses: Array
    keyframes: Keyframes
    ledger: list[LoopRecord]
    graph: PoseGraph
    map: PointCloud

    @property
    def loops(self) -> int:
        """Number of accepted loops."""
        return sum(record.status == "accepted" for record in self.ledger)

    def corrected(self, poses: Array) -> Array:
        """Correct odometry poses (N, 4, 4) of frames 0, 1 .. by the corrections of the keyframes before and after."""
        if not self.loops:
            return poses
        indices = self.keyframes.indices
        return corrected_poses(poses, indices, self.keyframes.poses, self.poses, indices[self._starts].tolist())

    def segments_note(self, frames: Array) -> str:
        """Say where the odometry began new segments, and which of them loops join; '' for a single one.

        Args:
            frames: (N,) numbers of the run's frames in the data set.
        """
        loops = self.graph.edges[len(self.poses) - 1 :] if len(self.poses) else ()
        return segments_note(self._starts, frames[self.keyframes.indices], unjoined(self._starts, loops))

    @property
    def _starts(self) -> list[int]:
        return segment_starts(self.graph.edges[: max(len(self.poses) - 1, 0)])


@dataclass(frozen=True, eq=False)
class LoopProgress:
    """The loops that are closed so far, before they are selected jointly at the end.

    Attributes:
        indices: (K,) positions in the run of the keyframes so far.
        odometry: (K, 4, 4) their odometry poses T_world_keyframe.
        optimised: (K, 4, 4) the poses with the loops.
        loops: Positions in the run of the two frames of each loop, the earlier one first.
    """

    indices: Array
    odometry: Array
    optimised: Array
    loops: tuple[tuple[int, int], ...]

    def corrected(self, poses: Array) -> Array:
        """Correct odometry poses (N, 4, 4) of frames 0, 1 .., as `corrected_poses`."""
        return corrected_poses(poses, self.indices, self.odometry, self.optimised)


@dataclass
class Mapper:
    """Builds a `MappingResult` from registered scans.

    One thread processes the scans in order, so the result does not depend on timing. The loops of a keyframe are
    searched as soon as all keyframes of its submap exist.

    Attributes:
        config: The settings.
        on_loops: Called in the thread when loops are closed, with all loops so far.
        journal: Receives keyframes, edges and loops; a mapper continues from its snapshot, if it has one.
        milliseconds: Run times by the stages `STAGES`.
    """

    config: Config
    on_loops: Callable[[LoopProgress], None] | None = None
    journal: Journal | None = None
    milliseconds: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})

    def __post_init__(self) -> None:
        self._record = MappingRecord(self.journal) if self.journal else None
        state = self.journal.state if self.journal else None
        kept = kept_keyframes(self.journal.file) if self.journal and state else []
        self._keyframes, self._back_end = Keyframes(self.config.keyframes, self._record, kept), BackEnd()
        self._search = LoopSearch(self.config.loops)
        self._thread = ThreadPoolExecutor(1, "mapper")
        self._waiting: deque[Future[None]] = deque()
        self._travelled, self._last = 0.0, np.zeros(3)
        self._covariance = np.zeros((6, 6))  # sum of the registration covariances since the last keyframe
        self._motion: tuple[Array, Array] | None = None  # of the keyframe that is not complete, since the one before
        self._lost = False  # whether the next keyframe begins a segment
        self._closed: list[tuple[int, int]] = []  # keyframes of the loops so far
        if self.journal and state:
            self._restore(self.journal, state["mapper"])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(wait=kind is None)  # after an exception, do not wait for a solver

    def close(self, wait: bool = True) -> None:
        """End the thread; without `wait`, its current task continues in the background."""
        self._thread.shutdown(wait=wait, cancel_futures=True)

    def add(self, position: int, frame: Frame, recorded: PointCloud, step: OdometryStep) -> None:
        """Queue a scan; block if `MAX_QUEUED_SCANS` are waiting. Exceptions of earlier scans are raised here.

        Args:
            position: Position of the frame in the run.
            frame: The frame, for its image.
            recorded: The cloud in sensor geometry, on which the image is projected.
            step: The registered scan.
        """
        self._submit(MAX_QUEUED_SCANS, self._add, position, frame, recorded, step)

    def check(self) -> None:
        """Raise the exception of an earlier scan, if there is one."""
        while self._waiting and self._waiting[0].done():
            self._waiting.popleft().result()

    def snapshot(self, parts: dict[str, Any], counts: dict[str, int], late: Callable[[], Any]) -> None:
        """Queue a snapshot of the run after the scans so far.

        Args:
            parts: The frozen states of the other parts, by name.
            counts: Number of rows of the tables of frames and problems.
            late: Returns a further state, called when all scans so far are mapped.
        """
        self._submit(MAX_QUEUED_SCANS, self._snapshot, parts, counts, late)

    def _submit(self, most: int, task: Callable[..., None], *arguments: Any) -> None:
        """Queue a task; wait while `most` or more are queued."""
        self.check()
        while len(self._waiting) >= most:
            self._waiting.popleft().result()
        self._waiting.append(self._thread.submit(task, *arguments))

    def corrected(self, poses: Array) -> Array:
        """Correct odometry poses (N, 4, 4) of the frames so far by the loops closed so far."""
        return self._thread.submit(self._corrected, poses).result()

    def finish(self) -> MappingResult:
        """Search the last keyframes for loops, select the consistent loops, and build the map."""
        self._waiting.append(self._thread.submit(self._finish))
        while self._waiting:
            self._waiting.popleft().result()
        ledger, poses = self._back_end.ledger(), self._optimised()
        if self._record:
            self._record.result(poses, ledger)
        world = build_map(self._keyframes, poses, self.config.map)
        return MappingResult(poses, self._keyframes, ledger, self._back_end.graph(), world)

    def _add(self, position: int, frame: Frame, recorded: PointCloud, step: OdometryStep) -> None:
        begin = time.perf_counter()
        self._travelled += float(np.linalg.norm(step.pose[:3, 3] - self._last))
        self._last = step.pose[:3, 3]
        self._covariance = self._covariance + step.covariance
        if step.restarted:
            self._end_segment()
        if step.status == "failed":
            return
        begins = self._keyframes.begins(step.pose)
        cloud = _coloured(step.cloud, recorded, frame) if begins and self.config.map.colour else step.cloud
        done = self._keyframes.add(cloud, step.pose, position, self._travelled)
        self.milliseconds["map"].append(1e3 * (time.perf_counter() - begin))
        if done is not None:
            self._close(self.config.loops.verification.query_submap_radius)
        if begins:
            self._motion = self._motion_since(self._keyframes[-1], step.pose) if len(self._keyframes) else None
            self._covariance, self._lost = np.zeros((6, 6)), False

    def _end_segment(self) -> None:
        """Complete the current keyframe; the next one begins a new segment at an unknown place."""
        if self._keyframes.finish() is not None:
            self._close(self.config.loops.verification.query_submap_radius)
            self._motion = None
        self._travelled += SEGMENT_DISTANCE
        self._lost = True

    def _optimised(self) -> Array:
        """Poses of the keyframes (K, 4, 4): the odometry poses until a loop is closed."""
        poses = self._keyframes.poses
        return poses[0] @ self._back_end.poses() if self._back_end.has_loops else poses

    def _corrected(self, poses: Array) -> Array:
        if not self._back_end.has_loops:
            return poses
        indices, starts = self._keyframes.indices, segment_starts(self._back_end.odometry)
        return corrected_poses(poses, indices, self._keyframes.poses, self._optimised(), indices[starts].tolist())

    def _finish(self) -> None:
        self._keyframes.finish()
        self._close(0.0)
        self._back_end.settle()

    def _close(self, radius: float) -> None:
        """Add the newest keyframe to the graph, and search loops of the keyframes at least `radius` [m] behind it."""
        begin = time.perf_counter()
        count = len(self._keyframes)
        if self._motion is not None:
            self._back_end.add_odometry(*self._motion)
            if self._record:
                self._record.edge(self._back_end.odometry[-1])
        graph, loops, travelled = time.perf_counter() - begin, 0.0, self._keyframes.travelled
        before = len(self._closed)
        while self.config.loops.enabled and len(self._search) < count:
            if travelled[len(self._search)] + radius > travelled[-1]:
                break
            begin = time.perf_counter()
            found = self._search.next(self._keyframes)
            loops += time.perf_counter() - begin
            begin = time.perf_counter()
            if self._record:
                self._record.place(travelled[len(self._search) - 1], self._search.descriptor)
            for candidate, verification in found:
                if self._record:
                    self._record.loop(candidate, verification)
                if verification.accepted:
                    self._back_end.add_loop(candidate, verification.covariance)
                    self._closed.append((candidate.i, candidate.j))
                else:
                    self._back_end.reject(candidate, verification.reason)
            graph += time.perf_counter() - begin
        self.milliseconds["loops"].append(1e3 * loops)
        self.milliseconds["back_end"].append(1e3 * graph)
        if self.on_loops and len(self._closed) > before:
            self.on_loops(self._progress())

    def _progress(self) -> LoopProgress:
        indices = self._keyframes.indices
        loops = tuple((int(indices[i]), int(indices[j])) for i, j in self._closed)
        return LoopProgress(indices, self._keyframes.poses, self._optimised(), loops)

    def _motion_since(self, before: Keyframe, pose: Array) -> tuple[Array, Array]:
        """Motion (4, 4) to `pose` since a keyframe, and its covariance (6, 6): registration plus drift."""
        distance = max(self._travelled - before.travelled, MIN_TRAVELLED)
        drift = GAP_COVARIANCE if self._lost else distance * drift_per_metre(self.config.pose_graph)
        return se3.normalized(se3.inverse(before.pose) @ pose), self._covariance + drift

    def _snapshot(self, parts: dict[str, Any], counts: dict[str, int], late: Callable[[], Any]) -> None:
        assert self.journal is not None
        state = {name: getattr(self, name) for name in STATE} | {"keyframes": self._keyframes.state()}
        rows = self.journal.counts() | counts
        self.journal.snapshot(rows, {**parts, "mapper": freeze(state), "late": freeze(late())})

    def _restore(self, journal: Journal, state: dict[str, Any]) -> None:
        """Continue from a snapshot."""
        for name in STATE:
            setattr(self, name, state[name])
        self._keyframes.restore(state["keyframes"])
        self._search.restore(*places(journal.file, self.config))
        add_edges(journal.file, self._back_end)
        edges = self._back_end.graph().edges[len(self._back_end.odometry) :]
        self._closed = [(edge.i, edge.j) for edge in edges]


def drift_per_metre(settings: PoseGraphSettings) -> Array:
    """Return the covariance (6, 6) that the odometry's drift adds per metre of travelled distance."""
    sigma = np.array([np.deg2rad(settings.rotation_drift_deg)] * 3 + [settings.translation_drift] * 3)
    return np.diag(sigma**2)


def corrected_poses(
    poses: Array, indices: Array, keyframes: Array, optimised: Array, starts: Sequence[int] = ()
) -> Array:
    """Correct the poses of frames by the optimised poses of their keyframes.

    The odometry gives the pose of a frame relative to the keyframe before and to the one after; the corrected pose
    interpolates between the two, by the number of frames to each. A keyframe gets its optimised pose. The interpolation
    is done in the keyframes' axes, so it does not depend on the world's origin.

    Args:
        poses: (N, 4, 4) odometry poses of frames 0, 1 ..
        indices: (K,) frames of the keyframes, increasing.
        keyframes: (K, 4, 4) odometry poses of the keyframes.
        optimised: (K, 4, 4) optimised poses of the keyframes.
        starts: Frames at which new segments begin, each with a keyframe: nothing is interpolated across.

    Returns:
        (N, 4, 4). Frames before the first or after the last keyframe of a segment move rigidly with it.
    """
    if len(starts):
        parts = []
        for begin, end in pairwise((0, *starts, len(poses))):
            inside = (indices >= begin) & (indices < end)
            own = (indices[inside] - begin, keyframes[inside], optimised[inside])
            parts.append(corrected_poses(poses[begin:end], *own))
        return np.concatenate(parts)
    before, after, share = se3.neighbours(indices, np.arange(len(poses)))
    start, end = (optimised[near] @ (se3.inverse(keyframes[near]) @ poses) for near in (before, after))
    return se3.blend(start, end, share)


def _coloured(cloud: PointCloud, recorded: PointCloud, frame: Frame) -> PointCloud:
    """The registered cloud with the colours that the cameras saw; images are projected on the points as recorded."""
    colour = with_colours(recorded, frame.views).colour
    return cloud if colour is None else replace(cloud, colour=colour)
