"""Mapping behind the odometry: keyframes are gathered in one thread, their loops searched in another."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np

from slam.data.cloud import Array, Frame, PointCloud
from slam.data.growing import Growing
from slam.data.machine import trim_memory
from slam.gathering import Completed, Gatherer
from slam.graph.back_end import BackEnd
from slam.graph.ledger import Ledger
from slam.journal.journal import Journal
from slam.journal.state import Frozen, freeze
from slam.journal.tables import KEYFRAME
from slam.loops.closing import LoopSearch
from slam.mapping.global_map import build_map
from slam.mapping.keyframes import Keyframes, SomeKeyframes
from slam.mapping_record import MappingRecord, add_edges, kept_keyframes, restore_places
from slam.mapping_result import LoopProgress, MappingResult, corrected_poses, mapped
from slam.odometry import OdometryStep
from slam.segments import segment_starts
from slam.settings import Config

MAX_QUEUED_SCANS = 6  # the odometry blocks when gathering is this many scans behind: bounds the memory
MAX_QUEUED_KEYFRAMES = 50  # the same of the search, at 100 m of path: files are read as fast as scans are registered


@dataclass
class Mapper:
    """Builds a `MappingResult` from registered scans.

    One thread gathers the scans into keyframes, in order; a second one searches the loops of the complete keyframes, in
    order. Each step of it sees only the keyframes up to the one that caused it, so the result does not depend on
    timing. The odometry waits for the first thread, and for the second one only where it is far behind. The loops of a
    keyframe are searched as soon as all keyframes of its submap exist.

    Attributes:
        config: The settings.
        on_loops: Called in the second thread when loops are closed, with all loops so far.
        journal: Receives keyframes, edges and loops; a mapper continues from its snapshot, if it has one.
    """

    config: Config
    on_loops: Callable[[LoopProgress], None] | None = None
    journal: Journal | None = None

    def __post_init__(self) -> None:
        self._record = MappingRecord(self.journal) if self.journal else None
        state = self.journal.state if self.journal else None
        kept = kept_keyframes(self.journal.file) if self.journal and state else []
        self._keyframes = Keyframes(self.config.keyframes, self._record, kept)
        self._gatherer = Gatherer(self.config, self._keyframes)
        self._search, self._back_end = LoopSearch(self.config.loops, self.config.keyframes), BackEnd()
        self._gathering, self._searching = (ThreadPoolExecutor(1, name) for name in ("gathering", "loops"))
        self._scans: deque[Future[None]] = deque()
        self._searches: deque[Future[None]] = deque()
        self._completed: deque[Completed] = deque()  # keyframes that are not in the graph yet
        self._snapshots: deque[tuple[dict[str, Frozen], dict[str, int]]] = deque()  # to be written
        self._stopped = False  # the keyframes that are left are not searched, but belong to the snapshots
        self._count = 0  # number of keyframes in the graph
        self._ended: Future[None] | None = None  # the completion of the last keyframe
        self._settled: Future[None] | None = None  # the selection of the loops after it
        self._selected: tuple[Array, Ledger] | None = None  # poses and decisions after it
        self._forgotten: list[int] = []  # keyframes whose clouds are forgotten since the last snapshot
        self._closed = Growing(2)  # keyframes of the loops so far
        self._laps = {"loops": Growing(), "back_end": Growing()}  # ms
        if self.journal and state:
            self._restore(self.journal, state)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(wait=kind is None)  # after an exception, do not wait for a solver

    def close(self, wait: bool = True) -> None:
        """End the threads; without `wait`, what they are working at continues in the background."""
        self._stopped = not wait
        self._gathering.shutdown(wait=wait, cancel_futures=True)
        self._searching.shutdown(wait=wait, cancel_futures=True)

    @property
    def milliseconds(self) -> dict[str, Array]:
        """Run times by stage: 'map' per scan, 'loops' and 'back_end' per keyframe."""
        return {name: laps.array() for name, laps in (("map", self._gatherer.milliseconds), *self._laps.items())}

    def add(self, position: int, frame: Frame, recorded: PointCloud, step: OdometryStep) -> None:
        """Queue a scan; block if too many scans or keyframes are waiting. Exceptions of earlier scans are raised here.

        Args:
            position: Position of the frame in the run.
            frame: The frame, for its image.
            recorded: The cloud in sensor geometry, on which the image is projected.
            step: The registered scan.
        """
        self._submit(self._gather, position, frame, recorded, step)

    def check(self) -> None:
        """Raise the exception of an earlier scan, if there is one."""
        for tasks in (self._scans, self._searches):
            while tasks and tasks[0].done():
                _take_first(tasks)

    def snapshot(self, parts: dict[str, Any], counts: dict[str, int], late: Callable[[], Any]) -> None:
        """Queue a snapshot of the run after the scans so far.

        Args:
            parts: The frozen states of the other parts, by name.
            counts: Number of rows of the tables of frames and problems.
            late: Returns a further state, called when all scans so far are gathered.
        """
        self._submit(self._snapshot, parts, counts, late)

    def corrected(self, poses: Array) -> Array:
        """Correct odometry poses (N, 4, 4) of the frames so far by the loops closed so far."""
        gathered = self._gathering.submit(self._searching.submit, self._corrected, poses)
        return gathered.result().result()

    def finish(self) -> MappingResult:
        """Search the last keyframes for loops, select the consistent loops, and build the map.

        After an exception it can be called again: what was done is not repeated.
        """
        poses, ledger = self._selected = self._selected or self._select()
        trim_memory()
        world = build_map(*mapped(self._keyframes, poses, self._back_end), self.config.map)
        known = np.array(list(self._back_end.known), int)
        return MappingResult(poses, self._keyframes, ledger, self._back_end.graph(), world, known)

    def _select(self) -> tuple[Array, Ledger]:
        """Search the last keyframes, select the loops, and write the poses and the decisions; return both."""
        if self._ended is None:
            self._ended = self._gathering.submit(lambda: self._search_later(self._gatherer.finish()))
        while self._scans:
            _take_first(self._scans)
        self._ended.result()
        while self._searches:
            _take_first(self._searches)
        if self._settled is None:
            self._settled = self._searching.submit(self._back_end.settle)
        self._settled.result()
        poses, ledger = self._optimised(), self._back_end.ledger()
        if self._record:
            self._record.result(poses, ledger)
        del self._search  # the map is built in its memory
        return poses, ledger

    def _submit(self, task: Callable[..., None], *arguments: Any) -> None:
        """Queue a task of the first thread; wait while too many are queued."""
        self.check()
        while len(self._scans) >= MAX_QUEUED_SCANS:
            _take_first(self._scans)
        while len(self._searches) >= MAX_QUEUED_KEYFRAMES:
            _take_first(self._searches)
        self._scans.append(self._gathering.submit(task, *arguments))

    def _gather(self, position: int, frame: Frame, recorded: PointCloud, step: OdometryStep) -> None:
        for completed in self._gatherer.add(position, frame, recorded, step):
            self._search_later(completed)

    def _search_later(self, completed: Completed) -> None:
        self._completed.append(completed)
        self._searches.append(self._searching.submit(self._close_completed))

    def _close_completed(self) -> None:
        """In the second thread: add the keyframes that are complete now to the graph, and search their loops."""
        for _ in range(len(self._completed)):  # later ones have tasks of their own, which wait in memory
            if self._stopped:
                break
            self._write_snapshots()  # those from before this keyframe was complete: it must not be in the graph yet
            self._close(self._completed.popleft())

    def _close(self, completed: Completed) -> None:
        """Add a keyframe to the graph, and search loops of the keyframes whose submaps are complete with it."""
        begin = time.perf_counter()
        self._count = completed.count
        if completed.motion is not None:
            self._back_end.add_odometry(*completed.motion)
            if self._record:
                self._record.edge(self._back_end.odometry[-1])
        graph, loops = time.perf_counter() - begin, 0.0
        keyframes = SomeKeyframes(self._keyframes, range(completed.count))
        before = len(self._closed)
        while self.config.loops.enabled and len(self._search) < completed.count:
            place = keyframes.place(len(self._search))
            if place.travelled + completed.radius > keyframes.place(-1).travelled:
                break
            begin = time.perf_counter()
            found = self._search.next(keyframes, self._back_end.odometry)
            loops += time.perf_counter() - begin
            begin = time.perf_counter()
            known = self._search.descriptor is None
            if self._record:
                self._record.place(place.travelled, self._search.descriptor)
            for candidate, verification in found:
                if self._record:
                    self._record.loop(candidate, verification)
                if verification.accepted:
                    add = self._back_end.add_known if known else self._back_end.add_loop
                    add(candidate, verification.covariance)
                    self._closed.append(np.array([candidate.i, candidate.j]))
                else:
                    self._back_end.reject(candidate, verification.reason)
            graph += time.perf_counter() - begin
        self._forget(keyframes)
        self._laps["loops"].append(1e3 * loops)
        self._laps["back_end"].append(1e3 * graph)
        if self.on_loops and len(self._closed) > before:
            self.on_loops(self._progress())

    def _forget(self, keyframes: Keyframes | SomeKeyframes) -> None:
        """Forget the clouds that neither the search nor the map needs."""
        for number in self._search.released(keyframes):
            if number in self._back_end.known:
                self._keyframes.forget(number)
                if self.journal:
                    self._forgotten.append(number)

    def _optimised(self) -> Array:
        """Poses of the keyframes in the graph (K, 4, 4): the odometry poses until a loop is closed."""
        poses = self._keyframes.poses[: self._count]
        return poses[0] @ self._back_end.poses() if self._back_end.has_loops else poses

    def _corrected(self, poses: Array) -> Array:
        self._close_completed()
        if not self._back_end.has_loops:
            return poses
        indices, odometry = self._keyframes.indices[: self._count], self._keyframes.poses[: self._count]
        starts = indices[segment_starts(self._back_end.odometry)].tolist()
        return corrected_poses(poses, indices, odometry, self._optimised(), starts)

    def _progress(self) -> LoopProgress:
        indices = self._keyframes.indices[: self._count]
        loops = tuple((i, j) for i, j in indices[self._closed.array().astype(int)].tolist())
        return LoopProgress(indices, self._keyframes.poses[: self._count], self._optimised(), loops)

    def _snapshot(self, parts: dict[str, Any], counts: dict[str, int], late: Callable[[], Any]) -> None:
        """Freeze what is gathered; the second thread adds its part between two keyframes, and so waits for no other."""
        parts = {**parts, "gathered": freeze(self._gatherer.state()), "late": freeze(late())}
        self._snapshots.append((parts, counts | {KEYFRAME.name: len(self._keyframes)}))
        self._searches.append(self._searching.submit(self._write_snapshots))

    def _write_snapshots(self) -> None:
        """In the second thread: write the snapshots, with the keyframes up to each that are not in the graph yet."""
        while self._snapshots:
            assert self.journal is not None
            parts, counts = self._snapshots.popleft()
            left = [completed for completed in tuple(self._completed) if completed.count <= counts[KEYFRAME.name]]
            own = freeze({"laps": self._laps, "completed": left})
            forgotten, self._forgotten = self._forgotten, []
            self.journal.snapshot(self.journal.counts() | counts, {**parts, "mapper": own}, forgotten)
            trim_memory()

    def _restore(self, journal: Journal, state: Mapping[str, Any]) -> None:
        """Continue from a snapshot."""
        self._gatherer.restore(state["gathered"])
        restore_places(journal.file, self.config, self._keyframes.poses, self._search)
        add_edges(journal.file, self._back_end)
        for record in self._back_end.ledger():
            if record.status == "accepted":
                self._closed.append(np.array([record.candidate.i, record.candidate.j]))
        self._laps = state["mapper"]["laps"]
        self._completed.extend(state["mapper"]["completed"])  # closed with the next keyframe
        self._count = len(self._keyframes) - len(self._completed)
        self._forget(self._keyframes)


def _take_first(tasks: deque[Future[None]]) -> None:
    """Wait for the first task and remove it; one that failed stays, so that all later calls raise its exception."""
    tasks[0].result()
    tasks.popleft()
