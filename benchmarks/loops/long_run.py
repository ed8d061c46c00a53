"""A long run: rounds through a simulated town, again and again; memory and time per frame after the map was seen.

    python -m benchmarks.loops.long_run DRIVE --frames 20000

DRIVE is a simulated data set that comes back to its first frame, such as the town's loop. The scans from the first
frame up to that return are registered again and again, with stamps that go on, at 16 channels. Times are processor
times, so that other programs do not count; memory is what the process holds beside the scans. Prints a row per 250
frames, and writes long_run.md, .json and .png in benchmarks/results.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from mmap import mmap
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FunctionType, ModuleType
from typing import Any, TypeVar

import numpy as np

from benchmarks.common.page import surroundings, table, target, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.rounds import CHANNELS, Rounds
from eval.text import number
from slam.data import se3
from slam.data.cloud import Array
from slam.graph.pose_graph import Edges
from slam.session import save_run
from slam.slam import Slam

ROW = 250  # frames
DAY = 8 * 36_000  # frames of eight hours at 10 Hz
Result = TypeVar("Result")
PAGE = 4096 / 1e6  # MB


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("drive", type=Path, help="the simulated data set")
    arguments.add_argument("--frames", type=int, default=20_000, metavar="N", help="default: 20000")
    add_results(arguments)
    options = arguments.parse_args()
    found = measure(options.drive, options.frames)
    draw(found["rows"], found["lap"], options.results / "long_run.png")
    write_results(options.results, "long_run", found, page)


def measure(drive: Path, frames: int) -> dict[str, Any]:
    rounds = Rounds.of(drive)
    settings, truth = rounds.settings(), rounds.poses(frames)
    rows: list[dict[str, float]] = []
    with rounds.slam(settings) as slam:
        at_start, last = _memory(), _Clock()
        for number in range(frames):
            slam.add(rounds.frame(number))
            if (number + 1) % ROW == 0:
                rows.append(_row(slam, truth, last, _memory() - at_start))
                print(rows[-1], file=sys.stderr, flush=True)
        run, finish = _measured(slam.finish)
        with TemporaryDirectory() as folder:
            _, files = _measured(lambda: save_run(run, folder))
    assert run.mapping is not None
    errors = np.linalg.norm((se3.inverse(truth) @ run.poses)[:, :3, 3], axis=1)
    mapping, edges = run.mapping, Edges(run.mapping.graph.edges[: len(run.mapping.keyframes) - 1])
    return {
        "about": surroundings(("numpy", "numba", "gtsam")),
        "frames": frames,
        "lap": len(rounds.scans),
        "lap_m": rounds.metres,
        "rows": rows,
        "finish": finish,
        "files": files,
        "record_mb": _size(run.records),
        "graph_mb": _size(mapping.ledger, edges, mapping.keyframes.poses),
        "keyframe_ms": {stage: _quarters(run.milliseconds[stage]) for stage in ("loops", "back_end")},
        "keyframes": len(mapping.keyframes),
        "known": len(mapping.known),
        "loops": mapping.loops,
        "clouds_mb": (mapping.keyframes.spill.in_memory + mapping.keyframes.spill.on_disk) / 1e6,
        "clouds_limit_mb": settings.keyframes.memory_mb,
        "map_points": len(run.map),
        "error_max_m": float(errors.max()),
        "failed": run.counts()["failed"],
    }


class _Clock:
    """Processor times [s] since the last reading: of this thread, and of all others."""

    def __init__(self) -> None:
        self._own, self._all = time.thread_time(), time.process_time()

    def lap(self) -> tuple[float, float]:
        own, everything = time.thread_time(), time.process_time()
        spent = own - self._own, everything - self._all
        self._own, self._all = own, everything
        return spent[0], spent[1] - spent[0]


def _row(slam: Slam, truth: Array, clock: _Clock, memory: float) -> dict[str, float]:
    own, others = clock.lap()
    frames, record = len(slam.result.records), slam.result.records[-1]
    return {
        "frames": frames,
        "odometry_ms": 1e3 * own / ROW,
        "mapper_ms": 1e3 * others / ROW,
        "memory_mb": memory,
        "drift_m": float(np.linalg.norm((se3.inverse(truth[frames - 1]) @ record.pose)[:3, 3])),
    }


def _quarters(values: Sequence[float] | Array) -> list[float]:
    """Means of the second and of the last quarter."""
    quarter = max(len(values) // 4, 1)
    return [float(np.mean(values[quarter : 2 * quarter])), float(np.mean(values[-quarter:]))]


def _memory() -> float:
    """Memory [MB] of this process in use now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def _measured(work: Callable[[], Result]) -> tuple[Result, dict[str, float]]:
    """Do some work; return its result, its processor time, and the most memory that it took more."""
    Path("/proc/self/clear_refs").write_text("5")  # the peak memory begins again
    begin, before = time.process_time(), _memory()
    result = work()
    peak = int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) * 1024 / 1e6
    return result, {"seconds": time.process_time() - begin, "more_mb": peak - before}


def _size(*values: object) -> float:
    """Memory [MB] of objects with all that they refer to, and the arrays that they are parts of."""
    seen, waiting, total = set(), list(values), 0
    while waiting:
        one = waiting.pop()
        if id(one) not in seen and not isinstance(one, type | ModuleType | FunctionType):
            seen.add(id(one))
            total += len(one) if isinstance(one, mmap) else sys.getsizeof(one)
            waiting.extend(gc.get_referents(one))
            if isinstance(one, np.ndarray) and one.base is not None:
                waiting.append(one.base)
    return total / 1e6


def draw(rows: list[dict[str, float]], lap: int, path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (times, memory) = pyplot.subplots(2, 1, figsize=(8, 5.5), sharex=True, layout="constrained")
    frames = [row["frames"] for row in rows]
    times.plot(frames, [row["odometry_ms"] for row in rows], label="front end and odometry", color="tab:blue")
    times.plot(frames, [row["mapper_ms"] for row in rows], label="mapper: keyframes, loops, graph", color="tab:orange")
    times.set_ylabel("processor time per frame [ms]")
    times.set_ylim(0)
    times.legend(loc="lower right")
    memory.plot(frames, [row["memory_mb"] for row in rows], color="tab:green")
    memory.set_ylabel("memory beside the scans [MB]")
    memory.set_ylim(0)
    memory.set_xlabel(f"frames; a round has {lap}")
    for axes in (times, memory):
        axes.grid(alpha=0.3)
        axes.axvline(lap, color="grey", linestyle=":")
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def growth(rows: list[dict[str, float]], name: str) -> tuple[float, float, float]:
    """Mean of a figure in the second and in the last quarter of a run, and its growth per 1000 frames between them."""
    early, late = _quarters([row[name] for row in rows])
    return early, late, (late - early) / (ROW * len(rows) * 0.5 / 1000)


def page(found: Mapping[str, Any]) -> str:
    about, rows = found["about"], found["rows"]
    rounds, hours = found["frames"] / found["lap"], found["frames"] / 36_000
    of = {name: growth(rows, name) for name in ("odometry_ms", "mapper_ms", "memory_mb")}
    per_thousand = {name: found[name] / found["frames"] * 1000 for name in ("record_mb", "graph_mb")}
    end = {name: found["finish"][name] + found["files"][name] for name in ("seconds", "more_mb")}
    targets = table(
        ("target", "measured", "limit", "verdict"),
        [
            target("odometry per frame, last quarter to second quarter", of["odometry_ms"][1] / of["odometry_ms"][0],
                   "<", 1.1, 2),
            target("mapper per frame, the same", of["mapper_ms"][1] / of["mapper_ms"][0], "<", 1.1, 2),
            target("memory, MB per 1,000 frames between these quarters", of["memory_mb"][2], "<=", 1.0, 2),
            target("selection, map and files after the last frame, s", end["seconds"], "<", 180.0, 0),
            target("memory that these take more, MB",
                   max(found["finish"]["more_mb"], found["files"]["more_mb"]), "<", 300.0, 0),
        ],
    )  # fmt: skip
    shown = table(
        ("frames", "odometry ms", "mapper ms", "memory MB", "odometry off m"),
        [
            (
                f"{row['frames']:,}", number(row["odometry_ms"], 1), number(row["mapper_ms"], 1),
                number(row["memory_mb"], 0), number(row["drift_m"], 2),
            )
            for row in rows[:: max(len(rows) // 10, 1)]
        ],
    )  # fmt: skip
    mapped = found["keyframes"] - found["known"]
    more = (DAY - found["frames"]) / 1000
    return f"""
# A long run

`{about["command"]}` on {about["date"]}: {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]}.

{found["frames"]:,} frames at {CHANNELS} channels, {hours:.2f} h at 10 Hz: {rounds:.1f} rounds of {found["lap_m"]:.0f} m
through a simulated town, {rounds * found["lap_m"] / 1e3:.1f} km, by the default settings. {found["keyframes"]:,}
keyframes, {found["known"]:,} of them at [known places](../../docs/method.md), {found["loops"]:,} loops,
{found["failed"]} failed frames. After the loops the position is off by {found["error_max_m"]:.2f} m at most.
Milliseconds are processor time per frame, of {ROW} frames each; memory is that of the process beside the scans.

![Processor time per frame and memory over the run](long_run.png)

{targets}
{shown}
After the last frame, selecting the loops and building the map took {found["finish"]["seconds"]:.0f} s of processor time
and {found["finish"]["more_mb"]:.0f} MB more; the run folder took {found["files"]["seconds"]:.0f} s and
{found["files"]["more_mb"]:.0f} MB more. The map has {found["map_points"]:,} points.

## What grows

The map, the descriptors and the graph that is solved do not: {mapped:,} keyframes of the first visits are in them, and
keyframes at known places only get poses. Per keyframe, by the clock, the search for loops took {_pair(found, "loops")}
ms in the second and in the last quarter, the pose graph {_pair(found, "back_end")} ms. What remains of a frame:

* its record (pose, covariance, status, run times), {per_thousand["record_mb"]:.2f} MB per 1,000 frames;
* of each keyframe its pose, its odometry edge, its loop and the decision on it, {per_thousand["graph_mb"]:.2f} MB
  per 1,000 frames: `loops.csv`, `graph.g2o` and the poses at the end are made from them.

These are rows of arrays. As objects of their own they were scattered over the heap, whose free space could then be used
by ever fewer of the arrays of a scan: the process grew by 4.7 MB per 1,000 frames. In all, it grows by
{of["memory_mb"][2]:.2f} MB now.

Of the clouds, {found["clouds_mb"]:,.0f} MB are kept at the end, those of the first visits; beyond
{found["clouds_limit_mb"]:,.0f} MB (`keyframes.memory_mb`) they are in a file or the session. Those at known places are
[forgotten](../../docs/session.md) when nothing reads them again.

Extrapolated to eight hours in the same streets ({DAY:,} frames, {DAY / found["frames"] * found["keyframes"]:,.0f}
keyframes), if all that grows between the second and the last quarter grows on at the same rate:
{rows[-1]["memory_mb"] + max(of["memory_mb"][2], 0.0) * more:,.0f} MB of memory, and
{of["mapper_ms"][1] + max(of["mapper_ms"][2], 0.0) * more:.0f} ms per frame in the mapper's thread, of 100 ms that a
frame lasts.
"""


def _pair(found: Mapping[str, Any], stage: str) -> str:
    return " and ".join(number(value, 0) for value in found["keyframe_ms"][stage])


if __name__ == "__main__":
    run_script(main)
