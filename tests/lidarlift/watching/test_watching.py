"""Observers of a run: they receive everything, change nothing, and may fail."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Callable
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest

import lidarlift as package
from lidarlift.watching.background import Background, Observers
from lidarlift.watching.progress import MAX_PARTS, Progress
from lidarlift.watching.server import ProgressServer
from slam.data import se3
from slam.data.cloud import Array, Frame, PointCloud
from slam.mapping_result import LoopProgress
from slam.records import STAGES, FrameRecord
from slam.run import Observer, Run, Source
from slam.settings import Config

Drive = Callable[..., Path]
Command = Callable[..., Any]


class Seen(Observer):
    """Notes what an observer is told."""

    def __init__(self) -> None:
        self.run: Run | None = None
        self.records: list[FrameRecord] = []
        self.points: list[int] = []
        self.complete: Run | None = None

    def started(self, run: Run) -> None:
        self.run = run

    def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
        assert frame.index == record.index
        self.records.append(record)
        self.points.append(len(cloud))

    def loops_closed(self, progress: LoopProgress) -> None:
        raise AssertionError("no loops here")

    def finished(self, run: Run) -> None:
        assert run.mapping is not None
        self.complete = run


class Failing(Seen):
    def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
        super().registered(frame, cloud, record)
        raise RuntimeError("the window was closed")


def record(position: int, pose: Array) -> FrameRecord:
    return FrameRecord(
        100 + position, 0.1 * position, pose, np.eye(6), "registered", 0.9, 5, dict.fromkeys(STAGES, 0.0)
    )


def walked(count: int, step: float = 1.0) -> tuple[Progress, Run]:
    """A run of `count` frames, `step` metres apart, with one point 1 m ahead in each scan."""
    progress, run = Progress("walk", count + 3), Run(Source(), Config(), 0.0)
    progress.started(run)
    cloud = PointCloud(np.array([[1.0, 0, 0]]), np.zeros(1))
    for position in range(count):
        pose = se3.exp(np.array([0, 0, 0, step * position, 0, 0]))
        run.records.append(record(position, pose))
        progress.registered(Frame(100 + position, 0.0, cloud), cloud, run.records[-1])
    return progress, run


def test_an_observer_sees_every_frame_and_the_result(street_drive: Drive) -> None:
    seen = Seen()
    run = package.run(street_drive(), input="enriched", enricher="ray-segment", observer=seen)
    assert seen.run is run is seen.complete
    assert [each.index for each in seen.records] == list(range(8))
    assert seen.points == [each.points for each in run.records]


def test_a_failing_observer_is_noted_once_and_the_run_goes_on(street_drive: Drive) -> None:
    notes: list[str] = []
    failing = Failing()
    with Background(failing, notes.append) as observer:
        run = package.run(street_drive(), input="16", frames=slice(4), observer=Observers([observer, Seen()]))
    assert len(run.records) == 4
    assert len(failing.records) == 1
    assert notes == ["the view stopped: RuntimeError: the window was closed; the run goes on"]


def test_after_an_error_of_the_run_nothing_more_is_shown() -> None:
    begun, stopped = Event(), Event()

    class Slow(Seen):
        def started(self, run: Run) -> None:
            begun.set()
            stopped.wait()

    class Stopping(Background):
        def __exit__(self, *error: Any) -> None:
            Thread(target=lambda: (self._thread.join(0.05), stopped.set())).start()
            super().__exit__(*error)

    def interrupted() -> None:
        with Stopping(slow, print) as observer:
            observer.started(Run(Source(), Config(), 0.0))
            begun.wait()
            cloud = PointCloud(np.zeros((0, 3)), np.zeros(0))
            observer.registered(Frame(100, 0.0, cloud), cloud, record(0, np.eye(4)))
            raise KeyboardInterrupt

    slow = Slow()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert slow.records == []


@pytest.mark.parametrize("loops", ["true", "false"])
def test_the_page_changes_no_byte(lidarlift: Command, street_drive: Drive, loops: str) -> None:
    drive, setting = street_drive(), f"loops.enabled={loops}"
    for out, more in (("plain", ()), ("served", ("--serve", "0"))):
        result = lidarlift("run", drive, "--input", "16", "--set", setting, "--out", out, *more)
        assert result.code == 0, result.err
    assert "Note: progress of the run: http://127.0.0.1:" in result.err
    names = (
        "trajectory_tum.txt",
        "odometry_kitti.txt",
        "trajectory_covariance.csv",
        "map.pcd",
        "loops.csv",
        "graph.g2o",
    )
    for name in names:
        assert (Path("plain") / name).read_bytes() == (Path("served") / name).read_bytes(), name


def test_only_what_is_new_is_sent() -> None:
    progress, _ = walked(5)
    state = progress.state()
    assert (state["title"], state["frames"], state["total"]) == ("walk", 5, 8)
    assert state["counts"] == {"registered": 5, "retried": 0, "degenerate": 0, "failed": 0}
    assert state["last"] == {"frame": 104, "status": "registered", "points": 5}
    assert state["trajectory"] == [[0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0], [40, 0, 0]]
    assert state["map"] == [[[10, 0, 0]], [[30, 0, 0]], [[50, 0, 0]]]  # every 2 m
    news = progress.state(state["version"], 4, 2)
    assert (news["from"], news["trajectory"], news["map"]) == ([4, 2], [[40, 0, 0]], [[[50, 0, 0]]])
    assert not news["finished"]


def test_a_loop_sends_everything_again() -> None:
    progress, run = walked(5)
    before = progress.state()["version"]
    poses = np.array([each.pose for each in run.records])
    moved = poses.copy()
    moved[4, 1, 3] = 4.0  # the last keyframe 4 m to the left; those between are interpolated
    progress.loops_closed(LoopProgress(np.array([0, 4]), poses[[0, 4]], moved[[0, 4]], ((0, 4),)))
    state = progress.state(before, 5, 3)
    assert state["from"] == [0, 0]
    assert [position[1] for position in state["trajectory"]] == [0, 10, 20, 30, 40]
    assert state["map"][-1] == [[50, 40, 0]]
    assert state["loops"] == [[[0, 0, 0], [40, 40, 0]]]


def test_the_map_of_a_long_run_stays_small() -> None:
    progress, _ = walked(2 * MAX_PARTS + 10, step=3.0)
    state = progress.state()
    assert MAX_PARTS / 2 < len(state["map"]) <= MAX_PARTS
    assert state["version"] > 0
    assert len(state["trajectory"]) == 2 * MAX_PARTS + 10
    json.dumps(state, allow_nan=False)


def test_a_run_is_served_while_it_goes_on(street_drive: Drive) -> None:
    progress, found = Progress("street", 8), []

    class Reader(Seen):
        def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
            with urllib.request.urlopen(f"{server.url}progress.json") as answer:
                found.append(json.load(answer))

    with ProgressServer(progress.state) as server:
        package.run(street_drive(), input="16", frames=slice(3), observer=Observers([progress, Reader()]))
        with urllib.request.urlopen(f"{server.url}progress.json") as answer:
            last = json.load(answer)
    assert [state["frames"] for state in found] == [1, 2, 3]
    assert [state["finished"] for state in (*found, last)] == [False, False, False, True]
    assert len(found[0]["map"][0]) == 250
