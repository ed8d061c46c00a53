"""One run at the pace of the sensor, and the stages of mapping by themselves, as JSON; replayed.py starts it.

It runs with the Python of any version of lidarlift, so it imports nothing of the benchmarks.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

import lidarlift
from slam.data import camera
from slam.data.dataset import Dataset, open_dataset
from slam.data.machine import peak_memory
from slam.mapping.global_map import GlobalMap
from slam.mapping.keyframes import Keyframes
from slam.run import Run
from slam.settings import Config, MapSettings

READER = "read-ahead"  # name of the pipeline's thread that reads scans


def main() -> None:
    arguments = argparse.ArgumentParser(
        prog="python -m benchmarks.mapping.replayed_run",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    arguments.add_argument("sequence", type=Path)
    arguments.add_argument("folder", type=Path, help="of the run")
    arguments.add_argument("--input", default="64")
    arguments.add_argument("--enricher")
    arguments.add_argument("--frames", type=int)
    arguments.add_argument("--rate", type=float, default=10.0, help="scans a second; 0: as fast as possible")
    arguments.add_argument("--stages", type=int, default=0, help="scans of which mapping is measured by itself")
    options = arguments.parse_args()
    data = open_dataset(options.sequence)
    due, watch = _paced(data, 1.0 / options.rate) if options.rate else [], _Watch()
    about: Any = {"input": options.input, "enricher": options.enricher, "frames": slice(options.frames)}
    run = lidarlift.run(data, **about, out=options.folder, observer=watch)
    assert run.mapping is not None
    found: dict[str, Any] = {
        "frames": len(run.records),
        "keyframes": len(run.mapping.keyframes),
        "peak_mb": peak_memory(),
    }
    if due:
        found |= _waits(run, np.array(due), np.array(watch.registered_at))
    if options.stages:
        found["stages"] = _stages(data, run.odometry_poses[: options.stages], run.config)
    print(json.dumps(found))


class _Watch:
    """Notes when each scan is registered."""

    def __init__(self) -> None:
        self.registered_at: list[float] = []

    def registered(self, *_: Any) -> None:
        self.registered_at.append(time.perf_counter())

    def started(self, *_: Any) -> None: ...

    def loops_closed(self, *_: Any) -> None: ...

    def finished(self, *_: Any) -> None: ...


def _paced(data: Dataset, period: float) -> list[float]:
    """Let the run's scans arrive one a period; returns the times at which they are due, as they become known."""
    due: list[float] = []
    kind: Any = type(data)

    def arrives(self: Dataset, position: int) -> Any:
        frame = kind.__getitem__(self, position)
        if threading.current_thread().name.startswith(READER):
            due.append(due[-1] + period if due else time.perf_counter())
            time.sleep(max(due[-1] - time.perf_counter(), 0.0))
        return frame

    data.__class__ = type(kind.__name__, (kind,), {"__getitem__": arrives, "__module__": kind.__module__})
    return due


def _waits(run: Run, due: np.ndarray, registered: np.ndarray) -> dict[str, Any]:
    """Milliseconds from the time at which a scan is due to the beginning and to the end of its odometry.

    A scan's record has the time that it took, so its beginning follows from its end.
    """
    end, laps = registered[: len(due)], [record.milliseconds for record in run.records]
    took = np.array([lap["front_end"] + lap["odometry"] for lap in laps]) / 1e3
    after = np.array([lap["waiting"] for lap in laps]) / 1e3
    begins, ends = end - after - took - due, end - after - due
    return {"begins_ms": (1e3 * begins).round(1).tolist(), "ends_ms": (1e3 * ends).round(1).tolist()}


def _stages(data: Dataset, poses: np.ndarray, settings: Config) -> dict[str, Any]:
    """Processor time [ms] per keyframe of gathering and of the map, in one thread, and digests of their bytes.

    The second of two passes: the first one loads the kernels.
    """
    for _ in range(2):
        keyframes, gathered = Keyframes(settings.keyframes), 0.0
        for position, pose in enumerate(poses):
            frame = data[position]
            begin = time.thread_time()
            begins = keyframes.begins(pose)
            cloud = camera.with_colours(frame.cloud, frame.views) if begins else frame.cloud
            keyframes.add(cloud, pose, position, 2.0 * position)
            gathered += time.thread_time() - begin
        keyframes.finish()
        world, begin = GlobalMap(MapSettings()), time.thread_time()
        for keyframe in keyframes:
            world.insert(keyframe.cloud, keyframe.pose)
        world.carve((keyframe.view, keyframe.pose) for keyframe in keyframes)
        points = world.points()
        mapped = time.thread_time() - begin
    count = len(keyframes)
    stored = hashlib.sha256(b"".join(keyframes.spill.read(number) for number in range(count))).hexdigest()
    columns = (points.xyz, points.intensity, *(() if points.colour is None else (points.colour,)))
    drawn = hashlib.sha256(b"".join(column.tobytes() for column in columns)).hexdigest()
    return {"gathering_ms": 1e3 * gathered / count, "map_ms": 1e3 * mapped / count, "bytes": [stored, drawn]}


if __name__ == "__main__":
    main()
