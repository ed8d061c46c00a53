"""Odometry beside its peers on any drives and inputs: where it ends, in which frame it errs most, how long it takes.

    python -m benchmarks.odometry.scenes DRIVE [DRIVE ...] --inputs full 16 ray-segment lift

DRIVE is a folder that lidarlift reads, or one of the simulated drives of benchmarks/common/simulated.py, simulated once
into the user's cache. Writes scenes.md and .json in benchmarks/results; the JSON is [drive][input]["systems"][system],
with "about" beside the drives. Linux only (pins to a core).
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.common.simulated import SCENES, frame_numbers, scene
from benchmarks.odometry import inputs
from benchmarks.odometry.drive_arguments import add_frames, as_slice
from benchmarks.odometry.figures import figures
from benchmarks.odometry.measure import UNCOUNTED, WARM_UP, Run, alternate
from benchmarks.odometry.names import IN_SCENES, REFERENCE
from benchmarks.odometry.path_errors import along_track_error, worst_frame
from benchmarks.odometry.scenes_page import page
from benchmarks.odometry.systems import System, build
from enrichment.methods.registry import LIFT
from eval.evaluation import orthonormal
from eval.trajectory import path_length
from slam.data.cloud import Array
from slam.data.dataset import Dataset, chosen_positions, open_dataset
from slam.data.errors import InputError

PACKAGES = ("numpy", "numba", "onnxruntime", "kiss-icp", "genz-icp", "small_gicp")


def main() -> None:
    arguments = _arguments()
    about = surroundings(PACKAGES) | {"datasets": {}, "uncounted": UNCOUNTED}
    results: dict[str, Any] = {}
    for drive in arguments.drives:
        name, data, positions = opened(drive, arguments.frames, camera=LIFT in arguments.inputs)
        truth = None if data.ground_truth is None else data.ground_truth[positions]
        about["datasets"][name] = facts(data, positions, truth)
        results[name] = {each: entry(data, positions, truth, each) for each in arguments.inputs}
        write_results(arguments.results, "scenes", {"about": about, **results}, page)  # after each, for it takes long


def opened(drive: str, frames: str | None, camera: bool) -> tuple[str, Dataset, list[int]]:
    """A drive's name, the drive, and the positions of its frames that are driven. Raises InputError."""
    chosen = None if frames is None else as_slice(frames)
    if drive not in SCENES:
        data = open_dataset(drive)
        return data.name, data, list(chosen_positions(data, chosen or slice(None)))
    numbers = frame_numbers(drive, chosen)
    camera &= SCENES[drive].settings.sensor == "hdl64"  # sparser sensors are filled in without one
    data = scene(drive, camera, numbers)
    return drive, data, np.flatnonzero(np.isin(data.numbers, numbers)).tolist()


def facts(data: Dataset, positions: Sequence[int], truth: Array | None) -> dict[str, Any]:
    """What is driven, for the report."""
    known = None if truth is None else truth[np.isfinite(truth[:, 0, 0])]
    return {
        "frames": len(positions),
        "first": int(data.numbers[positions[0]]),
        "last": int(data.numbers[positions[-1]]),
        "sensor": None if data.sensor is None else data.sensor.name,
        "rings": None if data.sensor is None else data.sensor.ring_count,
        "truth_path_length_m": None if known is None or len(known) == 0 else path_length(known),
    }


def entry(data: Dataset, positions: Sequence[int], truth: Array | None, name: str) -> dict[str, Any]:
    """What the JSON has of a drive and an input; only `reason` where the drive does not have it."""
    reason = inputs.why_not(name, data)
    if reason:
        return {"reason": reason}
    start = perf_counter()
    runs, milliseconds = in_own_process(measured, data.path, positions, name)
    print(f"{data.path}: {name}, {len(positions)} frames: {perf_counter() - start:.0f} s", file=sys.stderr)
    systems = {
        system: figures([run], [runs[REFERENCE]], truth, None) | along(run, truth, data.numbers[positions])
        for system, run in runs.items()
    }
    return {
        "reason": None,
        "front_end_ms": float(np.median(milliseconds[WARM_UP:])) if milliseconds[WARM_UP:] else None,
        "systems": systems,
    }


def along(run: Run, truth: Array | None, numbers: Array) -> dict[str, Any]:
    """Where along the way it errs; `worst_frame` is the number of that frame's file."""
    nothing = {"along_track_m": None, "worst_m": None, "worst_frame": None}
    if run.error or truth is None:
        return nothing
    known = np.flatnonzero(np.isfinite(truth[:, 0, 0]))
    estimate, reference = orthonormal(np.array(run.poses)[known]), orthonormal(truth[known])
    worst = worst_frame(estimate, reference)
    if worst is None:
        return nothing
    return {
        "along_track_m": along_track_error(estimate, reference),
        "worst_m": worst[1],
        "worst_frame": int(numbers[known[worst[0]]]),
    }


Measured = tuple[dict[str, Run], list[float]]  # by system, and milliseconds of the front end by frame


def in_own_process(measure: Callable[..., Measured], *case: Any, systems: Sequence[str] = IN_SCENES) -> Measured:
    """`measure` of a case and systems, in a process of its own. Where that breaks down, each system is alone in one:
    the others' figures stay, and those that broke it have an error."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), pin_to_one_core) as worker:
        try:
            return worker.submit(measure, *case, systems).result()
        except BrokenProcessPool:
            if len(systems) == 1:
                return {systems[0]: Run(error="its process ended without a word: a crash, or too little memory")}, []
    runs: dict[str, Run] = {}
    milliseconds: list[float] = []
    for system in systems:
        run, milliseconds_now = in_own_process(measure, *case, systems=(system,))
        runs, milliseconds = runs | run, milliseconds_now or milliseconds
    return runs, milliseconds


def measured(path: Path, positions: Sequence[int], name: str, systems: Sequence[str]) -> Measured:
    """The systems by turns on the scans of a drive."""
    data, milliseconds = open_dataset(path), list[float]()
    ready, missing = _built(systems, inputs.channels(name, data), data)
    alternate(ready, inputs.scans(name, data, positions[:WARM_UP], []))  # compiles, imports; the systems are dropped
    ready, _ = _built(systems, inputs.channels(name, data), data)
    runs = alternate(ready, inputs.scans(name, data, positions, milliseconds)) | missing
    return {system: runs[system] for system in systems}, milliseconds


def _built(names: Sequence[str], channels: str, data: Dataset) -> tuple[dict[str, System], dict[str, Run]]:
    """Fresh systems, and the runs of those that are not installed."""
    ready: dict[str, System] = {}
    missing: dict[str, Run] = {}
    for name in names:
        try:
            ready[name] = build(name, channels, data)
        except ImportError as error:
            missing[name] = Run(error=f"not installed, see `make peers` ({error})")
    return ready, missing


def _arguments() -> argparse.Namespace:
    arguments = parser(__doc__)
    arguments.add_argument("drives", nargs="+", metavar="DRIVE", help=f"a folder, or one of {', '.join(SCENES)}")
    arguments.add_argument("--inputs", nargs="+", choices=inputs.names(), default=inputs.DEFAULT, metavar="INPUT",
                           help=f"some of {', '.join(inputs.names())}; by default %(default)s")  # fmt: skip
    add_frames(arguments, None)
    add_results(arguments)
    found = arguments.parse_args()
    for drive in found.drives:
        if drive not in SCENES and not Path(drive).is_dir():
            raise InputError(f"{drive}: no such folder, and no simulated drive; there are {', '.join(SCENES)}")
    return found


if __name__ == "__main__":
    run_script(main)
