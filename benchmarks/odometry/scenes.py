"""Odometry compared with its peers on any drives and inputs: error at the end, frame of the largest error, run time.

    python -m benchmarks.odometry.scenes SEQUENCE [SEQUENCE ...] --inputs full 16 ray-segment lift

SEQUENCE is a folder that lidarlift reads, or one of the simulated drives of benchmarks/common/simulated.py, or a town
along the path of KITTI 05, 06 or 07 (with --trajectories), simulated once into the user's cache. A folder's drive is
held against a dense trajectory, too. Writes scenes.md and .json in benchmarks/results; the JSON is
[drive][input]["systems"][system], with "about" beside the drives. Linux only (pins to a core).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from time import perf_counter
from types import MappingProxyType
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import surroundings, without_about, write_results
from benchmarks.common.script import RESULTS, add_results, parser, run_script
from benchmarks.odometry import inputs
from benchmarks.odometry.chosen_drives import ChosenDrive, add_drives, chosen_drives
from benchmarks.odometry.dense import dense_trajectory
from benchmarks.odometry.figures import figures
from benchmarks.odometry.measure import UNCOUNTED, WARM_UP, Run, alternate, built
from benchmarks.odometry.names import IN_SCENES, REFERENCE
from benchmarks.odometry.path_errors import along_track_error, corrected, worst_frame
from benchmarks.odometry.scenes_page import DEFAULT, page
from eval.evaluation import orthonormal
from eval.trajectory import path_length
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.data.errors import InputError

PACKAGES = ("numpy", "numba", "onnxruntime", "kiss-icp", "genz-icp", "small_gicp")


def main() -> None:
    arguments = _arguments()
    about = surroundings(PACKAGES) | {"datasets": {}, "uncounted": UNCOUNTED}
    about["before"] = before(arguments.before)
    results: dict[str, Any] = {}
    kept = {} if set(arguments.systems) == set(IN_SCENES) else json.loads((RESULTS / "scenes.json").read_text("utf-8"))
    if kept:
        measured_now = ", ".join(f"`{name}`" for name in arguments.systems)
        about["note"] = f"Measured: {measured_now}; the others' figures are those of {kept['about']['date']}."
    for drive in chosen_drives(arguments, images=not set(arguments.inputs) <= set(inputs.IMAGELESS)):
        dense = None if drive.simulated else dense_trajectory(drive.data.path, arguments.frames or ":")
        about["datasets"][drive.name] = facts(drive) | {"dense_failed": dense is None and not drive.simulated}
        earlier = kept.get(drive.name, {})
        results[drive.name] = {
            each: entry(drive, dense, each, arguments.systems, earlier.get(each, {})) for each in arguments.inputs
        }
        write_results(arguments.results, "scenes", {"about": about, **results}, page)  # after each, for it takes long


def before(path: Path) -> dict[str, Any]:
    """The date of an earlier run's file, and of its drives the number of frames and our default's ATE [m] by input.

    Raises InputError where it is no such file.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        drives = {
            drive: {
                "frames": found["about"]["datasets"][drive]["frames"],
                "ate_m": {
                    name: each["systems"][DEFAULT].get("ate_m")
                    for name, each in by_input.items()
                    if each["reason"] is None
                },
            }
            for drive, by_input in without_about(found).items()
        }
        return {"date": found["about"]["date"], "drives": drives}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: not a file of this script ({error!r}); name the scenes.json of another run"
        ) from error


def facts(drive: ChosenDrive) -> dict[str, Any]:
    """Facts about a drive for the report."""
    data, truth = drive.data, drive.truth
    known = None if truth is None else truth[np.isfinite(truth[:, 0, 0])]
    return {
        "frames": len(drive.positions),
        "first": int(drive.numbers[0]),
        "last": int(drive.numbers[-1]),
        "sensor": None if data.sensor is None else data.sensor.name,
        "rings": None if data.sensor is None else data.sensor.ring_count,
        "truth_path_length_m": None if known is None or len(known) == 0 else path_length(known),
    }


def entry(
    drive: ChosenDrive,
    dense: Array | None,
    name: str,
    measure: Sequence[str] = IN_SCENES,
    kept: Mapping[str, Any] = MappingProxyType({}),
) -> dict[str, Any]:
    """Measure the entry of a drive and an input for the JSON; only `reason` if the drive does not have this input.

    dense    (N, 4, 4) of the dense yardstick, or None
    measure  the systems; the others' figures are those of `kept`, the same entry of an earlier run
    """
    reason = inputs.why_not(name, drive.data)
    if reason:
        return {"reason": reason}
    start = perf_counter()
    runs, milliseconds = in_own_process(measured, drive.data.path, drive.positions, name, systems=measure)
    print(f"{drive.name}: {name}, {len(drive.positions)} frames: {perf_counter() - start:.0f} s", file=sys.stderr)
    systems = {
        system: figures([run], [runs.get(REFERENCE, Run(error="not measured"))], drive.truth, dense)
        | along(run, drive.truth, drive.numbers)
        for system, run in runs.items()
    }
    return {
        "reason": None,
        "front_end_ms": float(np.median(milliseconds[WARM_UP:])) if milliseconds[WARM_UP:] else None,
        "systems": {name: (kept.get("systems") or {}).get(name) for name in IN_SCENES if name not in systems} | systems
        if kept
        else systems,
    }


def along(run: Run, truth: Array | None, numbers: Array) -> dict[str, Any]:
    """Compute errors along the path.

    `worst_frame` is the number of a frame's file; `untold` are the errors without those of frames that the odometry
    reported as degenerate or failed.
    """
    nothing: dict[str, Any] = {"along_track_m": None, "worst_m": None, "worst_frame": None, "untold": None}
    if run.error or truth is None:
        return nothing
    known = np.flatnonzero(np.isfinite(truth[:, 0, 0]))
    estimate, reference = orthonormal(np.array(run.poses)[known]), orthonormal(truth[known])
    worst = worst_frame(estimate, reference)
    if worst is None:
        return nothing
    told = np.isin(np.array(run.statuses, dtype=object)[known], ("degenerate", "failed"))
    left = corrected(estimate, reference, told)
    return {
        "along_track_m": along_track_error(estimate, reference),
        "worst_m": worst[1],
        "worst_frame": int(numbers[known[worst[0]]]),
        "untold": {"path_length_m": path_length(left), "along_track_m": along_track_error(left, reference)},
    }


Measured = tuple[dict[str, Run], list[float]]  # by system, and milliseconds of the front end by frame


def in_own_process(measure: Callable[..., Measured], *case: Any, systems: Sequence[str] = IN_SCENES) -> Measured:
    """Run `measure` for a case and systems in a process of its own.

    If the process crashes, each system is run in its own process, and those that crash get an error.
    """
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
    ready, missing = built(systems, inputs.channels(name, data), data)
    alternate(ready, inputs.scans(name, data, positions[:WARM_UP], []))  # compiles, imports; the systems are dropped
    ready, _ = built(systems, inputs.channels(name, data), data)
    runs = alternate(ready, inputs.scans(name, data, positions, milliseconds)) | missing
    return {system: runs[system] for system in systems}, milliseconds


def _arguments() -> argparse.Namespace:
    arguments = parser(__doc__)
    add_drives(arguments)
    inputs.add_inputs(arguments, inputs.DEFAULT)
    arguments.add_argument("--before", type=Path, default=RESULTS / "scenes_before.json", metavar="JSON",
                           help="scenes.json of an earlier run, whose ATE is shown next to ours")  # fmt: skip
    arguments.add_argument("--systems", nargs="+", choices=IN_SCENES, default=list(IN_SCENES), metavar="SYSTEM",
                           help="some of %(choices)s; the others keep the figures that they have")  # fmt: skip
    add_results(arguments)
    return arguments.parse_args()


if __name__ == "__main__":
    run_script(main)
