"""From how many first frames of a drive an odometry starts with a wrong motion: in traffic, over bridges, at speed.

    python -m benchmarks.odometry.starts SEQUENCE [SEQUENCE ...] --inputs full 16

Which motion an odometry takes from the first two scans is chance to a part, and one drive from its first frame does not
show it. Here it begins anew at every second frame. SEQUENCE is a folder with ground truth or one of the simulated
drives of benchmarks/common/simulated.py. Writes starts.md and .json in benchmarks/results.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.common.cores import ONE_THREAD

os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import table, without_about
from benchmarks.common.script import run_script
from benchmarks.odometry import inputs
from benchmarks.odometry.by_drive import TITLES, measure_by_drive
from benchmarks.odometry.chosen_drives import ChosenDrive
from benchmarks.odometry.measure import Scan
from benchmarks.odometry.names import SYSTEMS
from benchmarks.odometry.systems import System, build
from slam.data.cloud import Array

STARTS, STEP, LENGTH = 31, 2, 26  # first frames, frames between them, frames from each
MAX_SHARE, MAX_ERROR = 0.03, 0.1  # of the distance from first to last frame: share of it, and m
FAR = 0.2  # of the distance, in brackets


def main() -> None:
    measure_by_drive(__doc__, "starts", wrong_starts, page)


def wrong_starts(drive: ChosenDrive, name: str, system: str) -> dict[str, Any]:
    """Start a system at every second frame of a drive, and return the `starts`, and those which are `wrong`.

    Wrong is a start if the distance from its first to its last frame errs by more than a share of it.
    """
    data, truth = drive.data, drive.truth
    assert truth is not None
    last = min(len(drive.positions), (STARTS - 1) * STEP + LENGTH)
    scans = list(inputs.scans(name, data, drive.positions[:last], []))
    starts, wrong = range(0, last - LENGTH + 1, STEP), []
    for first in starts:
        chosen = slice(first, first + LENGTH)
        driven = _distance(poses_of(build(system, inputs.channels(name, data), data), scans[chosen]))
        true = _distance(truth[chosen])
        if not abs(driven - true) <= MAX_SHARE * true + MAX_ERROR:
            wrong.append({"first": first, "driven_m": driven, "true_m": true})
    return {"starts": len(starts), "wrong": wrong}


def poses_of(odometry: System, scans: Sequence[Scan]) -> Array:
    """Register scans, and return their poses (N, 4, 4), as later scans revised them."""
    poses: list[Array] = []
    for cloud, stamp in scans:
        pose = odometry.register(cloud, stamp)
        for back, step in enumerate(reversed(odometry.revised), start=1):
            poses[-back] = step.pose
        poses.append(pose)
    return np.array(poses)


def _distance(poses: Array) -> float:
    return float(np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3]))


def page(found: Mapping[str, Any]) -> str:
    """Make the page."""
    about, drives = found["about"], without_about(found)
    systems = [system for system in SYSTEMS if any(system in each for by in drives.values() for each in by.values())]
    header = ("sequence", "input", "starts", *(f"wrong, {TITLES.get(system, system)}" for system in systems))
    rows = [
        (drive, name, str(max(each["starts"] for each in counts.values())), *(_wrong(counts, s) for s in systems))
        for drive, by_input in drives.items()
        for name, counts in by_input.items()
    ]
    return f"""# Starts

{about["date"]}, {about["cpu"]}. `{about["command"]}`

* The odometry begins anew at every second frame of a sequence, {STARTS} times if it is long enough, and gets {LENGTH}
  scans. Wrong: the distance from first to last pose errs by more than {100 * MAX_SHARE:g} % and {MAX_ERROR:g} m.
  In brackets: by more than a fifth of the way. The others lose the first metres, as one that begins as if at rest.
* The first two scans often fit each other in several ways: as if the sensor stood still among its own rings, moved with
  the vehicles around it, or had passed one more post of a railing. Nothing but later scans can tell.

{table(header, rows, words=2)}"""


def _wrong(counts: Mapping[str, Any], system: str) -> str:
    if system not in counts:
        return "-"
    wrong = counts[system]["wrong"]
    by_far = [each for each in wrong if abs(each["driven_m"] - each["true_m"]) > FAR * each["true_m"]]
    return f"{len(wrong)} ({len(by_far)})"


if __name__ == "__main__":
    run_script(main)
