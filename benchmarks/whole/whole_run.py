"""`lidarlift run`, everything included, beside KISS-ICP's odometry alone and a whole run of KISS-SLAM.

    python -m benchmarks.whole.whole_run BEFORE AFTER SEQUENCE [SEQUENCE ...]

BEFORE and AFTER are the commands lidarlift of two environments, an earlier version and this one. With --kiss-slam
TRAJECTORIES, the simulated loop and 05 are also run by KISS-SLAM, which `make peers` installs. All runs alternate,
pinned to one core. Writes whole_run.md and .json in benchmarks/results. Linux only.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

from benchmarks.common.page import surroundings, table, verdict, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.drives import drive
from benchmarks.loops.kiss_slam import PYTHON, theirs
from benchmarks.odometry.drive_arguments import add_drives
from benchmarks.whole.processes import alternated, run_of
from eval.text import number

#: Frame rate of the whole run by that of KISS-ICP's odometry, at least, by input.
TARGETS = {"64": 4.0, "ray-segment": 3.0, "lift": 1.5}
SLAM_TARGET = 3.0  # KISS-SLAM's time by that of the whole run, at least
SLAM_DRIVES = ("loop", "05")
PACKAGES = ("numpy", "numba", "gtsam", "kiss-icp")
HEADER = (
    "sequence", "input", "frames", "KISS-ICP ms", "before ms", "after ms", "before x", "after x", "limit", "",
)  # fmt: skip


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("before", type=Path, metavar="BEFORE", help="the command lidarlift of the earlier version")
    arguments.add_argument("after", type=Path, metavar="AFTER", help="the command lidarlift of this version")
    add_drives(arguments)
    arguments.add_argument("--inputs", nargs="+", default=list(TARGETS), choices=TARGETS)
    arguments.add_argument("--repeats", type=int, default=2, metavar="N")
    arguments.add_argument("--kiss-slam", type=Path, metavar="TRAJECTORIES", help="folder with the path of 05")
    arguments.add_argument("--slam-drives", nargs="+", default=SLAM_DRIVES, choices=SLAM_DRIVES)
    arguments.add_argument("--python", type=Path, default=PYTHON, help="the interpreter that has kiss-slam")
    add_results(arguments)
    options = arguments.parse_args()
    found: dict[str, Any] = {"about": surroundings(PACKAGES), "kiss_icp": {}, "kiss_slam": {}}
    # before the cores are one: the simulation has as many processes as there are cores
    drives = {name: drive(name, options.kiss_slam) for name in options.slam_drives} if options.kiss_slam else {}
    pin_to_one_core()
    for sequence in options.datasets:
        makers = {"KISS-ICP": partial(odometry_of_kiss_icp, sequence, options.frames)}
        for input in options.inputs:
            makers[f"{input}, before"] = partial(run_of, options.before, sequence, input, options.frames)
            makers[f"{input}, after"] = partial(run_of, options.after, sequence, input, options.frames)
        found["kiss_icp"][sequence.name] = alternated(makers, options.repeats)
        print(sequence.name, found["kiss_icp"][sequence.name], file=sys.stderr)
    for name, data in drives.items():
        makers = {
            "KISS-SLAM": partial(theirs, data, "64", options.python),
            "before": partial(run_of, options.before, data.path, "64"),
            "after": partial(run_of, options.after, data.path, "64"),
        }
        found["kiss_slam"][name] = alternated(makers, options.repeats)
        print(name, found["kiss_slam"][name], file=sys.stderr)
    write_results(options.results, "whole_run", found, page)


def odometry_of_kiss_icp(sequence: Path, frames: str) -> dict[str, Any]:
    """Processor time and number of frames of KISS-ICP's odometry, in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.whole.kiss_icp", str(sequence), f"--frames={frames}"]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return dict(json.loads(done.stdout))


def page(found: Mapping[str, Any]) -> str:
    """Make the page."""
    about = found["about"]
    return f"""# Whole runs

{about["date"]}, {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]} at the beginning.
`{about["command"]}`

* Everything is pinned to one core, one thread each, and counted in processor seconds, which other programs on the
  machine change least; on a core of its own they are the wall time. The runs alternate; the one with the least
  processor time counts.
* A whole run is the process `lidarlift run` from its start to the written report: imports, kernels from the cache,
  reading, enrichment, odometry, loops, map, metrics, figures, report. "Before" is an earlier version, in the same run.
* KISS-ICP is its odometry alone at 64 channels, in its defaults, on scans that are in memory: no reading, no imports,
  no map, no files. Its frame rate is held against that of whole runs.
* KISS-SLAM's time is that from its first scan to its last optimisation, reading included, without its imports and
  without the files that it writes.

## Whole runs and KISS-ICP's odometry

{table(HEADER, _icp(found["kiss_icp"]), words=2)}
{_slam(found["kiss_slam"])}"""


def _icp(sequences: Mapping[str, Any]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for sequence, entries in sequences.items():
        kiss = per_frame(entries["KISS-ICP"])
        for input, limit in TARGETS.items():
            if f"{input}, after" not in entries:
                continue
            before, after = (per_frame(entries[f"{input}, {version}"]) for version in ("before", "after"))
            figures = (number(kiss, 1), number(before, 1), number(after, 1), number(kiss / before, 2))
            judged = (number(kiss / after, 2), f"≥ {limit:g}", verdict(kiss / after, "≥", limit))
            rows.append((sequence, input, str(entries["KISS-ICP"]["frames"]), *figures, *judged))
    return rows


def per_frame(entry: Mapping[str, Any]) -> float:
    """Processor time per frame [ms]."""
    return 1000 * float(entry["processor_s"]) / int(entry["frames"])


def _slam(drives: Mapping[str, Any]) -> str:
    if not drives:
        return ""
    rows = []
    for name, entries in drives.items():
        kiss, before, after = (entries[who]["processor_s"] for who in ("KISS-SLAM", "before", "after"))
        judged = (number(kiss / after, 2), f"≥ {SLAM_TARGET:g}", verdict(kiss / after, "≥", SLAM_TARGET))
        figures = (number(kiss, 1), number(before, 1), number(after, 1), number(kiss / before, 2))
        rows.append((name, str(entries["after"]["frames"]), *figures, *judged))
    header = ("sequence", "frames", "KISS-SLAM s", "before s", "after s", "before x", "after x", "limit", "")
    return f"\n## Whole runs and KISS-SLAM, 64 channels\n\n{table(header, rows)}"


if __name__ == "__main__":
    run_script(main)
