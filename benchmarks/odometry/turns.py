"""How an odometry follows abrupt turns of the sensor: found, failed with a word, or wrong in silence.

    python -m benchmarks.odometry.turns SEQUENCE [SEQUENCE ...] --inputs full 16

Recorded or simulated scans are turned about the sensor's z axis as if it had turned by an angle in the time of one
sweep, and then had gone on as before. Points with times are turned by the angle at their time. SEQUENCE is a folder
with ground truth or one of the simulated drives of benchmarks/common/simulated.py. Writes turns.md and .json in
benchmarks/results.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
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
from slam.data import se3
from slam.data.cloud import Array, PointCloud

DEGREES = (0, 3, 6, 9, 12)  # without a turn for comparison; else to the left and to the right by turns
BEFORE, AFTER = 20, 5  # scans before the turn and from its end on
STEP, TURNS = 12, 8  # frames between two turns, and their maximum number, of each angle
MAX_METRES, MAX_DEGREES = 0.3, 1.0  # of the motion from before the turn to the last scan
FOUND, FAILED, WRONG = "found", "failed", "wrong"


def main() -> None:
    measure_by_drive(__doc__, "turns", outcomes, page)


def outcomes(drive: ChosenDrive, name: str, system: str) -> dict[str, dict[str, int]]:
    """Count the outcomes of a system's runs around turns of a drive, by their angles."""
    data, truth = drive.data, drive.truth
    assert truth is not None
    last = min(len(drive.positions), BEFORE + (TURNS - 1) * STEP + AFTER)
    scans = list(inputs.scans(name, data, drive.positions[:last], []))
    counted: dict[str, dict[str, int]] = {}
    for number, degrees in enumerate(DEGREES):
        counts = dict.fromkeys((FOUND, FAILED, WRONG), 0)
        for at in range(BEFORE, last - AFTER + 1, STEP):
            turn = np.deg2rad(degrees if (at // STEP + number) % 2 else -degrees)
            chosen = slice(at - BEFORE, at + AFTER)
            counts[outcome(build(system, inputs.channels(name, data), data), scans[chosen], truth[chosen], turn)] += 1
        counted[str(degrees)] = counts
    return counted


def outcome(odometry: System, scans: Sequence[Scan], truth: Array, turn: float) -> str:
    """Register scans (N), the first BEFORE of them before a turn [rad], and compare with true poses (N, 4, 4)."""
    begin, end = scans[BEFORE - 1][1], scans[BEFORE][1]
    poses, statuses = [], []
    for cloud, stamp in scans:
        poses.append(odometry.register(turned(cloud, stamp, begin, end, turn), stamp))
        statuses.append(odometry.status)
    true = se3.inverse(truth[BEFORE - 2]) @ truth[-1] @ se3.exp(np.array([0, 0, turn, 0, 0, 0]))
    error = se3.inverse(true) @ se3.inverse(poses[BEFORE - 2]) @ poses[-1]
    if np.linalg.norm(error[:3, 3]) < MAX_METRES and np.rad2deg(se3.angle(error)) < MAX_DEGREES:
        return FOUND
    return FAILED if "failed" in statuses[BEFORE - 1 :] else WRONG


def turned(cloud: PointCloud, stamp: float, begin: float, end: float, turn: float) -> PointCloud:
    """The cloud as seen by a sensor that turns about its z axis from time `begin` to `end` [s] by `turn` [rad]."""
    times = stamp + (np.zeros(len(cloud)) if cloud.time is None else cloud.time)
    angle = turn * np.clip((times - begin) / (end - begin), 0, 1)
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, z = cloud.xyz.T
    return replace(cloud, xyz=np.column_stack([cos * x + sin * y, cos * y - sin * x, z]).astype(np.float32))


def page(found: Mapping[str, Any]) -> str:
    """Make the page."""
    about, drives = found["about"], without_about(found)
    systems = [system for system in SYSTEMS if any(system in each for by in drives.values() for each in by.values())]
    titles = (f"{TITLES.get(system, system)}: found / failed / wrong" for system in systems)
    header = ("sequence", "input", "degrees", "turns", *titles)
    drives["all"] = {"": {system: _summed(drives, system) for system in systems}}
    rows = [
        (drive, name, degrees, *_cells([counts[system][degrees] for system in systems]))
        for drive, by_input in drives.items()
        for name, counts in by_input.items()
        for degrees in next(iter(counts.values()))
    ]
    limits = f"{MAX_METRES:g} m and {MAX_DEGREES:g} degree"
    return f"""# Abrupt turns

{about["date"]}, {about["cpu"]}. `{about["command"]}`

* The scans of a sequence are turned about the sensor's z axis as if it had turned by an angle within one sweep, and
  then had gone on as before: at 10 Hz, 3 degrees are 30 degrees a second. Points with times are distorted accordingly.
  {BEFORE} scans come before the turn, {AFTER} follow.
* Found: the motion from before the turn to the last scan errs by less than {limits}. Failed: it does not,
  but a scan since the turn was reported as failed. Wrong: neither. KISS-ICP does not report failures.

{table(header, rows, words=2)}"""


def _summed(drives: Mapping[str, Any], system: str) -> dict[str, Counter[str]]:
    """Outcomes of a system on all sequences and inputs, by the angle."""
    sums: dict[str, Counter[str]] = {}
    for by_input in drives.values():
        for counts in by_input.values():
            for degrees, counted in counts[system].items():
                sums.setdefault(degrees, Counter()).update(counted)
    return sums


def _cells(counted: Sequence[Mapping[str, int]]) -> tuple[str, ...]:
    """The number of turns, and the outcomes of each system."""
    outcomes_of = (" / ".join(str(each[what]) for what in (FOUND, FAILED, WRONG)) for each in counted)
    return str(sum(counted[0].values())), *outcomes_of


if __name__ == "__main__":
    run_script(main)
