"""Does our odometry bear clocks that jump, frames that are missing, other cell sizes, stops, and does it repeat?

    python -m benchmarks.odometry.disturbed SEQUENCE [SEQUENCE ...]

SEQUENCE is a folder that lidarlift reads, or one of the simulated drives of benchmarks/common/simulated.py, simulated
once into the user's cache. Errors are against the exact truth of simulated drives, and against a dense trajectory of
others. Writes disturbed.md and .json in benchmarks/results. Linux only (pins to a core).
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.odometry import inputs
from benchmarks.odometry.chosen_drives import ChosenDrive, add_drives, chosen_drives
from benchmarks.odometry.dense import dense_trajectory
from benchmarks.odometry.disturbances import Schedule, moving, scaled
from benchmarks.odometry.disturbed_page import page
from benchmarks.odometry.measure import alternate, built
from benchmarks.odometry.names import OURS, REFERENCE
from benchmarks.odometry.own_run import OwnRun, base_sizes, own_run
from benchmarks.odometry.path_errors import along_track_error
from eval.evaluation import orthonormal
from eval.trajectory import ate
from slam.data.cloud import Array
from slam.data.dataset import open_dataset

CLOCK = (2.0, 37.0, 3600.0, -2.0)  # s
STEPS = (2, 3)  # every 2nd and every 3rd frame
FACTORS = (0.75, 1.5)
STOPPING = "crawl"
Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Case:
    """An input of a drive, and the reference (N, 4, 4) that errors are against, None where there is none."""

    drive: ChosenDrive
    input: str
    reference: Array | None

    @property
    def schedule(self) -> Schedule:
        return Schedule.recorded(self.drive.data, self.drive.positions)

    @cached_property
    def undisturbed(self) -> OwnRun:
        return self.run(self.schedule)

    def run(self, schedule: Schedule, overrides: Sequence[str] = ()) -> OwnRun:
        """Our odometry on frames of the drive."""
        return own_run(self.drive.data, schedule.frames(self.drive.data), self.input, overrides)

    def error(self, poses: Array, index: Array | slice = slice(None)) -> float | None:
        """Compute the ATE [m] of poses (M, 4, 4) of the frames selected by an index."""
        return None if self.reference is None else distance(poses, self.reference[index])


def main() -> None:
    options = _arguments()
    pin_to_one_core()
    found: dict[str, Any] = {"about": surroundings(("numpy", "numba", "kiss-icp", "small_gicp"))}
    found |= {part: [] for part in options.parts}
    for drive in chosen_drives(options, images=not set(options.inputs) <= set(inputs.IMAGELESS)):
        reference = _reference(drive, options.frames or ":")
        for name in options.inputs:
            if inputs.why_not(name, drive.data) is None:
                _measure(Case(drive, name, reference), options.parts, found)
        write_results(options.results, "disturbed", found, page)  # after each, for it takes long


def _measure(case: Case, parts: Sequence[str], found: dict[str, Any]) -> None:
    for part in parts:
        start = perf_counter()
        rows = [{"drive": case.drive.name, "input": case.input} | row for row in PARTS[part](case)]
        found[part] += rows
        print(f"{case.drive.name}, {case.input}: {part}, {perf_counter() - start:.0f} s", file=sys.stderr)


def clock(case: Case) -> list[Row]:
    """The clock jumps in the middle: how far is it from the run without?"""
    rows = []
    for seconds in CLOCK:
        run = case.run(case.schedule.clock_set(seconds))
        apart = distance(run.poses, case.undisturbed.poses)
        rows.append({"seconds": seconds, "apart_m": apart} | _told(run))
    return rows


def thinned(case: Case) -> list[Row]:
    """Measure every n-th frame, and the reference among the peers."""
    rows = []
    ours = next(iter(OURS))
    data = case.drive.data
    for step in STEPS:
        ready, missing = built((ours, REFERENCE), inputs.channels(case.input, data), data, step)
        scans = inputs.scans(case.input, data, case.drive.positions[::step], [])
        runs = alternate(ready, scans) | missing
        index = slice(None, None, step)
        errors = {
            name: None if run.error else case.error(orthonormal(np.array(run.poses)), index)
            for name, run in runs.items()
        }
        told: Row = {"degenerate": runs[ours].count("degenerate"), "lost": runs[ours].count("failed")}
        rows.append({"step": step, "ours_m": errors[ours], "kiss_m": errors[REFERENCE]} | told)
    return rows


def sizes(case: Case) -> list[Row]:
    """All cells and voxels larger or smaller than the first scan has them."""
    data = case.drive.data
    base = base_sizes(case.input, data, data[case.drive.positions[0]])
    row: Row = {"sizes_m": base, "base_m": case.error(case.undisturbed.poses), "scaled_m": {}}
    for factor in FACTORS:
        run = case.run(case.schedule, scaled(base, factor))
        row["scaled_m"][f"{factor:g}"] = case.error(run.poses)
    return [row]


def stops(case: Case) -> list[Row]:
    """Stops left out, not recorded, and added: on the drive that has some, whose truth is exact."""
    if case.drive.name != STOPPING:
        return []
    truth, schedule = case.drive.exact_truth, case.schedule
    keep, everything = moving(truth), np.arange(len(truth))
    rows = []
    for what, changed, index in (
        ("as it is", schedule, everything),
        ("frames that stand left out", schedule.chosen(keep), keep),
        ("never standing", schedule.chosen(keep, closed_up=True), keep),
        ("standing longer", *schedule.stopping()),
    ):
        run = case.run(changed)
        apart = distance(run.poses, truth[index])
        along = along_track_error(run.poses, truth[index])
        rows.append({"what": what, "frames": len(index), "ate_m": apart, "along_track_m": along} | _told(run))
    return rows


def repeated(case: Case) -> list[Row]:
    """The same once more, in a process of its own: bit for bit?"""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), pin_to_one_core) as worker:
        again = worker.submit(once_more, case.drive.data.path, case.drive.positions, case.input).result()
    return [{"equal": bool(np.array_equal(again, case.undisturbed.poses))}]


def once_more(path: Path, positions: Sequence[int], name: str) -> Array:
    """Our poses (N, 4, 4) on an input of a drive."""
    data = open_dataset(path)
    return own_run(data, Schedule.recorded(data, positions).frames(data), name).poses


PARTS: dict[str, Callable[[Case], list[Row]]] = {
    "clock": clock, "thinned": thinned, "sizes": sizes, "stops": stops, "repeated": repeated,
}  # fmt: skip


def distance(poses: Array, reference: Array) -> float:
    """Rmse [m] of positions after SE(3) alignment."""
    return ate(orthonormal(poses), reference).rmse


def _told(run: OwnRun) -> Row:
    return {"degenerate": int((run.statuses == "degenerate").sum()), "lost": int((run.statuses == "failed").sum())}


def _reference(drive: ChosenDrive, frames: str) -> Array | None:
    """Return the reference of a drive: exact ground truth, or else a dense trajectory, None if that fails."""
    if drive.simulated:
        return drive.exact_truth
    dense = dense_trajectory(drive.data.path, frames)
    return None if dense is None else orthonormal(dense)


def _arguments() -> argparse.Namespace:
    arguments = parser(__doc__)
    add_drives(arguments)
    inputs.add_inputs(arguments, inputs.IMAGELESS)
    arguments.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART",
                           help=f"some of {', '.join(PARTS)}, by default all; stops: of {STOPPING} alone")  # fmt: skip
    add_results(arguments)
    return arguments.parse_args()


if __name__ == "__main__":
    run_script(main)
