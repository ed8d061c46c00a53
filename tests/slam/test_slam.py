"""SLAM frame by frame: results before the end."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from slam import mapper
from slam.config import load_config
from slam.data import se3
from slam.data.cloud import Array, Frame, PointCloud
from slam.data.errors import InputError
from slam.journal import journal as journals
from slam.journal.journal import Journal
from slam.journal.session_file import SessionFile
from slam.loops.closing import LoopSearch
from slam.loops.submap import submap
from slam.odometry import OdometryStep
from slam.recorded_odometry import RecordedSteps
from slam.records import STAGES
from slam.recovery import recovered
from slam.run import Run
from slam.slam import Slam

SIDE, FRAMES = 24.0, 124  # m, side of a square block; more than one round


def way() -> Array:
    """Poses (N, 4, 4), one per metre."""
    corners, poses = np.array([[0, 0], [SIDE, 0], [SIDE, SIDE], [0, SIDE]]), []
    for metre in np.arange(0.0, FRAMES):
        side, along = int(metre // SIDE) % 4, metre % SIDE
        pose = se3.exp(np.array([0, 0, side * np.pi / 2, 0, 0, 0]))
        pose[:2, 3] = corners[side] + along * np.array([np.cos(side * np.pi / 2), np.sin(side * np.pi / 2)])
        poses.append(pose)
    return np.array(poses)


def scan(pose: Array) -> PointCloud:
    """Points within 30 m, on posts, boxes and the ground around the block."""
    rng = np.random.default_rng(1)
    centres = rng.uniform(-25, SIDE + 25, (120, 1, 2))
    boxes = centres + rng.uniform(-1, 1, (120, 40, 2)) * rng.uniform(0.2, 2, (120, 1, 2))
    heights = rng.uniform(-1.7, 3, (120, 40, 1)) * rng.uniform(0.3, 1, (120, 1, 1))
    ground = np.column_stack([rng.uniform(-30, SIDE + 30, (4000, 2)), np.full(4000, -1.7)])
    world = np.concatenate([np.concatenate([boxes, heights], axis=2).reshape(-1, 3), ground])
    local = se3.inverse(pose)
    points = world @ local[:3, :3].T + local[:3, 3]
    points = points[np.linalg.norm(points, axis=1) < 30]
    return PointCloud(points, np.zeros(len(points)))


class Drifting:
    """Odometry with a drift of 0.03 deg and 1 cm per metre."""

    sizes = None

    def __init__(self) -> None:
        motion = se3.inverse(way()[:-1]) @ way()[1:]
        poses = [np.eye(4)]
        for step in motion:
            poses.append(poses[-1] @ step @ se3.exp(np.array([0, 0, np.deg2rad(0.03), 0.01, 0, 0])))
        self.poses, self._next = np.array(poses), 0

    def predict(self, stamp: float) -> Array:
        return self.poses[self._next]

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        self._next += 1
        return OdometryStep(self.poses[self._next - 1], 1e-6 * np.eye(6), "registered", None, cloud)

    def settle(self) -> tuple[OdometryStep, ...]:
        return ()


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return [Frame(number, 0.1 * number, scan(pose)) for number, pose in enumerate(way())]


def slam() -> Slam:
    overrides = ["loops.scan_context.min_travelled_distance=60"]
    return Slam(load_config(None, overrides), odometry=Drifting())


def off(poses: Array) -> Array:
    return np.linalg.norm(poses[:, :3, 3] - way()[: len(poses), :3, 3], axis=1)


def test_the_trajectory_so_far_is_corrected_by_the_loops_so_far(frames: list[Frame]) -> None:
    with slam() as it:
        for frame in frames[:90]:
            it.add(frame)
        np.testing.assert_array_equal(it.trajectory(), it.result.odometry_poses)  # no place was revisited so far
        for frame in frames[90:]:
            it.add(frame)
        before, now = off(it.result.odometry_poses)[-4:], off(it.trajectory())[-4:]
        run = it.finish()
    assert now.max() < 0.5 * before.min()
    assert off(run.poses)[-4:].max() < 0.5 * before.min()
    np.testing.assert_array_equal(it.trajectory(), run.poses)


def test_reading_the_trajectory_does_not_change_the_result(frames: list[Frame]) -> None:
    """Two runs of the same code are equal bit for bit."""
    results = []
    for every in (7, 1000):
        with slam() as it:
            for position, frame in enumerate(frames):
                it.add(frame)
                if position % every == every - 1:
                    it.trajectory()
            results.append(it.finish())
    assert results[0].mapping is not None
    assert results[0].mapping.loops > 0
    np.testing.assert_array_equal(results[0].poses, results[1].poses)


def test_an_exception_stops_the_thread(frames: list[Frame]) -> None:
    it = slam()
    with suppress(KeyboardInterrupt), it:
        it.add(frames[0])
        raise KeyboardInterrupt
    with pytest.raises(RuntimeError, match="shutdown"):
        it.add(frames[1])


def stamped(frames: list[Frame], *stamps: float) -> list[Frame]:
    return [replace(frame, stamp=stamp) for frame, stamp in zip(frames, stamps, strict=False)]


def test_implausible_stamps_are_counted(frames: list[Frame]) -> None:
    with slam() as it:
        for frame in stamped(frames, 0.0, 0.1, 0.1, 0.2, 0.05, 0.15, 0.15, 2.0):
            it.add(frame)
        run = it.finish()
    assert run.counts() | {"repeated_stamp": 2, "backward_stamp": 1, "stamp_jump": 1} == run.counts()
    assert [problem.message.partition(":")[0] for problem in run.problems] == [
        f"frame {number}" for number in (2, 4, 6, 7)
    ]


def test_strict_stops_before_a_frame_with_an_implausible_stamp(frames: list[Frame]) -> None:
    with Slam(odometry=Drifting(), strict=True) as it:
        first, second, third = stamped(frames, 0.0, 0.1, 0.1)
        it.add(first)
        it.add(second)
        with pytest.raises(InputError, match="frame 2: its stamp"):
            it.add(third)
        assert len(it.result.records) == 2
        assert it.result.problems == []


@pytest.mark.parametrize("stamp", [float("nan"), float("inf")])
def test_a_stamp_that_is_not_finite_is_an_error(frames: list[Frame], stamp: float) -> None:
    with slam() as it, pytest.raises(InputError, match=r"the stamp is (nan|inf); give the scan's time in seconds"):
        it.add(replace(frames[0], stamp=stamp))


def journaled(
    frames: list[Frame], journal: Journal | None, stop: int | None = None, visits: int = 2, wait: bool = False
) -> Run:
    """The run over the frames, with a journal; `stop` leaves at that frame, places are known after `visits`.

    `wait` searches all loops of a frame before the next one.
    """
    with with_short_submaps(journal, visits) as it:
        for frame in frames[len(it.result.records) : stop]:
            it.add(frame)
            if wait:
                it.trajectory()
        if stop is not None:
            raise KeyboardInterrupt
        return it.finish()


def with_short_submaps(journal: Journal | None, visits: int = 2) -> Slam:
    """SLAM with submaps so short that the second round leaves those of the first one."""
    reach = ("loops.verification.match_submap_radius=2.5", "loops.verification.query_submap_radius=2.5")
    search = ("loops.scan_context.min_travelled_distance=60", "loops.scan_context.submap_length=2")
    config = load_config(None, ["keyframes.memory_mb=0.1", f"keyframes.max_visits={visits}", *reach, *search])
    return Slam(config, odometry=RecordedSteps(Drifting().poses, 0.1, 0.0), journal=journal)


def test_a_run_that_is_stopped_while_keyframes_wait_for_the_search_resumes(
    frames: list[Frame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run is left while a search goes on; what that thread writes afterwards has the waiting keyframes."""
    monkeypatch.setattr(journals, "SNAPSHOT_EVERY", 0.0)
    added, reached, left, search = (*(threading.Event() for _ in range(3)), LoopSearch.next)

    def late(self: LoopSearch, keyframes: Any, odometry: Any) -> Any:
        if len(self) == 4:
            added.wait(60)  # now several keyframes wait, for one task
        if len(self) == 5:
            reached.set()
            left.wait(60)
        return search(self, keyframes, odometry)

    with Journal.begin(tmp_path / "s", {}) as journal:
        monkeypatch.setattr(LoopSearch, "next", late)
        with suppress(KeyboardInterrupt), with_short_submaps(journal) as it:
            for frame in frames[:30]:
                it.add(frame)
            added.set()
            assert reached.wait(60)
            for frame in frames[30:40]:
                it.add(frame)  # their snapshots are written after that search
            raise KeyboardInterrupt
        left.set()
        for thread in threading.enumerate():
            if thread.name.startswith("loops"):
                thread.join()
    monkeypatch.undo()
    with Journal.resume(tmp_path / "s") as journal:
        resumed = journaled(frames, journal)
    assert resumed.poses.tobytes() == journaled(frames, None).poses.tobytes()


@pytest.mark.parametrize("visits", [1, 2])
def test_a_run_that_is_resumed_again_and_again_has_the_same_bits(
    frames: list[Frame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, visits: int
) -> None:
    """Equal bits: two runs of the same code."""
    monkeypatch.setattr(journals, "SNAPSHOT_EVERY", 0.0)
    whole = journaled(frames, None, visits=visits)
    about = {"settings": whole.config.model_dump(mode="json"), "input": {"T_camera0_lidar": None}}
    Journal.begin(tmp_path / "s", about).close()
    for stop in (1, 30, 31, 95, 104, 109):
        begin = Journal.resume if journals.has_snapshot(tmp_path / "s") else lambda folder: Journal.begin(folder, about)
        with begin(tmp_path / "s") as journal, suppress(KeyboardInterrupt):
            journaled(frames, journal, stop, visits)
        if stop == 30:
            with Journal.resume(tmp_path / "s") as journal:
                assert 0 < journal.counts()["frame"] <= 30
    with Journal.resume(tmp_path / "s") as journal:
        resumed = journaled(frames, journal, visits=visits)
        assert whole.mapping is not None
        assert resumed.mapping is not None
        assert whole.mapping.loops > 0
        assert (len(whole.mapping.known) > 0) == (visits == 1)
        assert resumed.mapping.known.tolist() == whole.mapping.known.tolist()
        assert resumed.poses.tobytes() == whole.poses.tobytes()
        assert resumed.map.xyz.tobytes() == whole.map.xyz.tobytes()
        assert resumed.map.intensity.tobytes() == whole.map.intensity.tobytes()
        assert [record.status for record in resumed.mapping.ledger] == [r.status for r in whole.mapping.ledger]
        assert resumed.problems == whole.problems
    found = recovered(tmp_path / "s" / "session.sqlite")  # the journal is closed: all rows are in the file
    assert len(found.map()) > 1000
    odometry = whole.odometry_poses
    assert off(found.poses)[-4:].max() < 0.5 * off(odometry)[-4:].min()


def test_clouds_at_known_places_are_emptied_when_nothing_reads_them_again(
    frames: list[Frame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Equal bits: two runs of the same code."""
    monkeypatch.setattr(journals, "SNAPSHOT_EVERY", 0.0)
    whole = journaled(frames, None, visits=1)
    about = {"settings": whole.config.model_dump(mode="json"), "input": {"T_camera0_lidar": None}}
    with Journal.begin(tmp_path / "s", about) as journal, suppress(KeyboardInterrupt):
        journaled(frames, journal, FRAMES, visits=1, wait=True)
    with SessionFile.open(tmp_path / "s" / "session.sqlite") as file:
        emptied = {number for number in range(journal.counts()["keyframe"]) if file.cloud(number) == b""}
    assert whole.mapping is not None
    assert emptied
    known = set(whole.mapping.known.tolist())
    assert emptied < known
    for number in set(range(len(whole.mapping.keyframes))) - known:  # each that may be found has its submap
        assert len(submap(whole.mapping.keyframes, number, 2.5, 10_000)) > 1000
    assert len(recovered(tmp_path / "s" / "session.sqlite").map()) > 1000
    with Journal.resume(tmp_path / "s") as journal:
        resumed = journaled(frames, journal, visits=1)
    assert resumed.poses.tobytes() == whole.poses.tobytes()
    assert resumed.map.xyz.tobytes() == whole.map.xyz.tobytes()


def test_finish_can_be_called_again_after_an_exception_while_the_map_is_built(
    frames: list[Frame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Equal bits, and no row is written twice."""

    def no_room(*_: object) -> None:
        raise MemoryError("no room")

    whole = journaled(frames, None, visits=1)
    with Journal.begin(tmp_path / "s", {}) as journal:
        config, steps = whole.config, RecordedSteps(Drifting().poses, 0.1, 0.0)
        with Slam(config, odometry=steps, journal=journal) as it:
            for frame in frames:
                it.add(frame)
            with monkeypatch.context() as scarce:
                scarce.setattr(mapper, "build_map", no_room)
                for _ in range(2):
                    with pytest.raises(MemoryError, match="no room"):
                        it.finish()
            with pytest.raises(ValueError, match="finished"):
                it.add(frames[0])
            run = it.finish()
        assert run.mapping is not None
        assert run.poses.tobytes() == whole.poses.tobytes()
        assert run.map.xyz.tobytes() == whole.map.xyz.tobytes()
        counts = journal.counts()
        assert counts["keyframe"] == counts["optimised"] == len(run.mapping.keyframes)
        assert counts["loop"] == counts["decision"] == len(run.mapping.ledger)


def test_an_exception_of_the_loop_search_is_raised_by_each_call(
    frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise MemoryError("no room")

    with slam() as it:
        it.add(frames[0])
        monkeypatch.setattr(it._mapper, "_close", fails)
        for _ in range(2):
            with pytest.raises(MemoryError, match="no room"):
                it.finish()
        assert it.result.mapping is None


def test_a_second_thread_is_refused(frames: list[Frame]) -> None:
    inside, done = threading.Event(), threading.Event()

    class Slow(Drifting):
        def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
            inside.set()
            assert done.wait(60)
            return super().register(cloud, stamp)

    with Slam(load_config(), odometry=Slow()) as it:
        thread = threading.Thread(target=it.add, args=(frames[0],))
        thread.start()
        assert inside.wait(60)
        with pytest.raises(RuntimeError, match="in use by another thread"):
            it.add(frames[1])
        with pytest.raises(RuntimeError, match="in use by another thread"):
            it.finish()
        done.set()
        thread.join()
        it.add(frames[1])
        assert len(it.result.records) == 2


def test_an_exception_of_the_mapper_is_raised_by_the_next_frame(
    frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise MemoryError("no room")

    with slam() as it:
        it.add(frames[0])
        it.trajectory()  # waits for the mapper
        monkeypatch.setattr(it._mapper, "_gather", fails)
        it.add(frames[1])
        with suppress(MemoryError):
            it.trajectory()
        with pytest.raises(MemoryError, match="no room"):
            it.add(frames[2])
        assert len(it.result.records) == 2


def test_a_frame_that_the_mapper_cannot_take_has_all_its_run_times(
    frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The results so far are written after an error, as of a full disk; their table of times has all stages."""

    def fails(*_: object) -> None:
        raise InputError("run: the disk is full")

    with slam() as it:
        it.add(frames[0])
        monkeypatch.setattr(it._mapper, "add", fails)
        with pytest.raises(InputError, match="full"):
            it.add(frames[1])
        assert [set(record.milliseconds) >= set(STAGES) for record in it.result.records] == [True, True]


CARRIED, AGAIN = 48, 20  # metre at which the sensor is carried back, and the metre where it goes on


class Carried:
    """Odometry that loses its way when the sensor is carried to another place, and restarts five scans later."""

    sizes = None

    def __init__(self, places: list[int]) -> None:
        self._places, self._next = places, 0
        self._shift = se3.exp(np.array([0, 0, 0.3, 4.0, 2.0, 0]))  # of what follows: the odometry goes on as before

    def predict(self, stamp: float) -> Array:
        pose = way()[self._places[self._next]]
        if self._next < CARRIED:
            return pose
        return way()[CARRIED] @ self._shift @ se3.inverse(way()[AGAIN]) @ pose

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        pose = self.predict(stamp)
        lost = CARRIED <= self._next < CARRIED + 5
        restarted, self._next = self._next == CARRIED + 4, self._next + 1
        status: Literal["failed", "registered"] = "failed" if lost else "registered"
        return OdometryStep(pose, 1e-6 * np.eye(6), status, None, cloud, restarted=restarted)

    def settle(self) -> tuple[OdometryStep, ...]:
        return ()


def carried(frames: list[Frame], *overrides: str) -> tuple[Run, Array]:
    """A run with a sensor that is carried, and its true poses."""
    places = [*range(CARRIED), *range(AGAIN, AGAIN + 40)]
    config = load_config(None, ["loops.scan_context.min_travelled_distance=60", *overrides])
    with Slam(config, odometry=Carried(places)) as it:
        for number, place in enumerate(places):
            it.add(replace(frames[place], index=number, stamp=0.1 * number))
        return it.finish(), way()[places]


def test_a_loop_joins_the_segments_of_a_sensor_that_was_carried(frames: list[Frame]) -> None:
    run, truth = carried(frames)
    distance = np.linalg.norm(run.poses[:, :3, 3] - truth[:, :3, 3], axis=1)
    assert np.linalg.norm(run.odometry_poses[-1, :3, 3] - truth[-1, :3, 3]) > 10
    assert distance[:CARRIED].max() < 0.3
    assert distance[CARRIED + 5 :].max() < 0.5
    (note,) = run.notes()
    assert f"began new segments at frames {CARRIED + 5}; loop closures join all segments" in note


def test_without_a_loop_the_segments_stay_apart(frames: list[Frame]) -> None:
    run, _ = carried(frames, "loops.enabled=false")
    np.testing.assert_array_equal(run.poses, run.odometry_poses)
    (note,) = run.notes()
    assert f"no loop closure joins those from frames {CARRIED + 5}" in note
