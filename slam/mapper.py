"""Behind the odometry: keyframes, loops and the pose graph, in a thread of their own."""

from __future__ import annotations

import time
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Self

import numpy as np

from slam.data import se3
from slam.data.camera import with_colours
from slam.data.cloud import Array, Frame, PointCloud
from slam.graph.back_end import BackEnd
from slam.graph.ledger import LoopRecord
from slam.graph.pose_graph import PoseGraph
from slam.loops.closing import LoopSearch
from slam.mapping.global_map import build_map
from slam.mapping.keyframes import Keyframes
from slam.odometry import OdometryStep
from slam.settings import Config

LEAST_WAY = 0.5  # m that the drift is reckoned with, though the car may have turned on the spot
AHEAD = 20  # scans that may wait: so many the odometry can be ahead, and the memory that they take
STAGES = ("map", "loops", "back_end")


@dataclass(frozen=True, eq=False)
class MappingResult:
    """What came of the keyframes.

    poses      (K, 4, 4) T_world_keyframe, optimised
    keyframes  with their poses by the odometry and their clouds
    ledger     every loop that was thought of
    graph      poses, odometry and accepted loops
    map        of the optimised poses, without what moved
    """

    poses: Array
    keyframes: Keyframes
    ledger: list[LoopRecord]
    graph: PoseGraph
    map: PointCloud

    @property
    def loops(self) -> int:
        """Accepted ones."""
        return sum(record.status == "accepted" for record in self.ledger)

    def corrected(self, poses: Array) -> Array:
        """Odometry poses (N, 4, 4) of frames 0, 1 .., moved as the keyframes before and after them were."""
        return placed(poses, self.keyframes.indices, self.keyframes.poses, self.poses) if self.loops else poses


@dataclass
class Mapper:
    """Takes registered scans and gives a `MappingResult`.

    All is done in the order of the scans by one thread, and depends on nothing but them: whatever the timing, the
    result is the same. A keyframe's loops are searched when the keyframes that its verification reaches for are there.
    """

    config: Config
    milliseconds: dict[str, list[float]] = field(default_factory=lambda: {stage: [] for stage in STAGES})

    def __post_init__(self) -> None:
        self._keyframes, self._back_end = Keyframes(self.config.keyframes), BackEnd()
        self._search = LoopSearch(self.config.loops)
        self._thread = ThreadPoolExecutor(1, "mapper")
        self._waiting: deque[Future[None]] = deque()
        self._way, self._last = 0.0, np.zeros(3)
        self._doubt = np.zeros((6, 6))  # sum of the registrations' covariances since the last keyframe
        self._doubts: list[Array] = []  # and of each keyframe since the one before

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(wait=kind is None)  # what is stopped should not wait for a solver

    def close(self, wait: bool = True) -> None:
        """End the thread; without `wait`, what it is at goes on unattended."""
        self._thread.shutdown(wait=wait, cancel_futures=True)

    def add(self, position: int, frame: Frame, recorded: PointCloud, step: OdometryStep) -> None:
        """The scan of the frame at `position` of the run, as recorded and as registered. Returns at once, unless the
        work is far behind; raises what went wrong with earlier scans."""
        while self._waiting and (len(self._waiting) >= AHEAD or self._waiting[0].done()):
            self._waiting.popleft().result()
        self._waiting.append(self._thread.submit(self._add, position, frame, recorded, step))

    def corrected(self, poses: Array) -> Array:
        """Odometry poses (N, 4, 4) of the frames so far, moved as the loops closed so far moved the keyframes."""
        return self._thread.submit(self._corrected, poses).result()

    def finish(self) -> MappingResult:
        """Search the last keyframes, judge all loops together, and build the map."""
        self._waiting.append(self._thread.submit(self._finish))
        while self._waiting:
            self._waiting.popleft().result()
        ledger, poses = self._back_end.ledger(), self._optimised()
        world = build_map(self._keyframes, poses, self.config.map)
        return MappingResult(poses, self._keyframes, ledger, self._back_end.graph(), world)

    def _add(self, position: int, frame: Frame, recorded: PointCloud, step: OdometryStep) -> None:
        begin = time.perf_counter()
        self._way += float(np.linalg.norm(step.pose[:3, 3] - self._last))
        self._last = step.pose[:3, 3]
        self._doubt = self._doubt + step.covariance
        if step.status == "failed":
            return
        begins = self._keyframes.begins(step.pose)
        cloud = _coloured(step.cloud, recorded, frame) if begins and self.config.map.colour else step.cloud
        done = self._keyframes.add(cloud, step.pose, position, self._way)
        if begins:
            self._doubts.append(self._doubt)
            self._doubt = np.zeros((6, 6))
        self.milliseconds["map"].append(1e3 * (time.perf_counter() - begin))
        if done is not None:
            self._close(self.config.loops.verification.query_reach)

    def _optimised(self) -> Array:
        """The keyframes' poses (K, 4, 4), as the odometry has them until a loop is closed."""
        poses = self._keyframes.poses
        return poses[0] @ self._back_end.poses() if self._back_end.has_loops else poses

    def _corrected(self, poses: Array) -> Array:
        if not self._back_end.has_loops:
            return poses
        return placed(poses, self._keyframes.indices, self._keyframes.poses, self._optimised())

    def _finish(self) -> None:
        self._keyframes.finish()
        self._close(0.0)
        self._back_end.settle()

    def _close(self, reach: float) -> None:
        """Put the newest keyframe into the graph, and search the loops of those that lie `reach` [m] back."""
        begin = time.perf_counter()
        count = len(self._keyframes)
        if count > 1:
            self._back_end.add_odometry(*self._motion(count - 1))
        graph, loops, ways = time.perf_counter() - begin, 0.0, self._keyframes.ways
        while self.config.loops.enabled and len(self._search) < count:
            if ways[len(self._search)] + reach > ways[-1]:
                break
            begin = time.perf_counter()
            found = self._search.next(self._keyframes)
            loops += time.perf_counter() - begin
            begin = time.perf_counter()
            for candidate, verification in found:
                if verification.accepted:
                    self._back_end.add_loop(candidate, verification.covariance)
                else:
                    self._back_end.reject(candidate, verification.reason)
            graph += time.perf_counter() - begin
        self.milliseconds["loops"].append(1e3 * loops)
        self.milliseconds["back_end"].append(1e3 * graph)

    def _motion(self, number: int) -> tuple[Array, Array]:
        """Of a keyframe since the one before: (4, 4), and its covariance (6, 6), the registrations' and the drift's."""
        before, here = self._keyframes.poses[number - 1 : number + 1]
        way = max(float(np.diff(self._keyframes.ways[number - 1 : number + 1])[0]), LEAST_WAY)
        settings = self.config.pose_graph
        drift = np.array([np.deg2rad(settings.rotation_deg)] * 3 + [settings.translation] * 3) ** 2 * way
        return se3.normalized(se3.inverse(before) @ here), self._doubts[number] + np.diag(drift)


def placed(poses: Array, indices: Array, keyframes: Array, optimised: Array) -> Array:
    """Where frames are, by where their keyframes are.

    A frame is put where the odometry saw it from the keyframe before it, and from the one after it, and between the two
    by how near in frames they are: at a keyframe its optimised pose. All this is in the keyframes' own axes, so it does
    not matter how far away the world's origin is.

    Args:
        poses: (N, 4, 4) of frames 0, 1 .. by the odometry.
        indices: (K,) the frames that are keyframes, rising.
        keyframes: (K, 4, 4) by the odometry.
        optimised: (K, 4, 4).

    Returns:
        (N, 4, 4). Frames before the first keyframe, or after the last, move rigidly with it.
    """
    before, after, share = se3.neighbours(indices, np.arange(len(poses)))
    start, end = (optimised[near] @ (se3.inverse(keyframes[near]) @ poses) for near in (before, after))
    return se3.blend(start, end, share)


def _coloured(cloud: PointCloud, recorded: PointCloud, frame: Frame) -> PointCloud:
    """The registered cloud with the colours that the cameras saw; images are projected on the points as recorded."""
    colour = with_colours(recorded, frame.views).colour
    return cloud if colour is None else replace(cloud, colour=colour)
