"""Waits of the odometry when scans arrive at the sensor's pace, peak memory, and the time of mapping, of two versions.

    python -m benchmarks.mapping.replayed OLD/bin/lidarlift NEW/bin/lidarlift SEQUENCE [SEQUENCE ...]

Each version is the command `lidarlift` of an environment of its own. They take turns, a process for each run.
Inputs are 64 and enriched by ray segments and by Lift, as in `--inputs 64 ray-segment lift`; Lift takes nearly as long
as a scan, so it runs as fast as it can, for its memory. Writes replayed.md and .json in benchmarks/results.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, verdict, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.odometry.drive_arguments import add_drives
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.machine import usable_cores

RUN = Path(__file__).with_name("replayed_run.py")
VERSIONS = ("before", "after")
INPUTS = {"64": (), "ray-segment": ("--enricher", "ray-segment"), "lift": ("--enricher", "lift")}
UNPACED = ("lift",)
STAGES = 60  # scans of which mapping is measured by itself
MAX_WAIT, MAX_PEAK, MAX_PEAK_LIFT, MAX_RATIO = 100.0, 600.0, 700.0, 0.5  # ms, MB, MB, of the time before
WARM_UP = 10  # scans at the beginning that are left out: kernels are loaded


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("before", type=Path, help="the command of the older version")
    arguments.add_argument("after", type=Path, help="that of the newer one")
    add_drives(arguments)
    arguments.add_argument("--inputs", nargs="+", choices=tuple(INPUTS), default=["64", "ray-segment", "lift"])
    arguments.add_argument("--rounds", type=int, default=2, metavar="N", help="of all measurements (default: 2)")
    add_results(arguments)
    options = arguments.parse_args()
    if options.frames != ":" and not options.frames.startswith(":"):
        raise InputError(f"--frames {options.frames}: runs begin with the first scan; write :B")
    commands = dict(zip(VERSIONS, (options.before.absolute(), options.after.absolute()), strict=True))
    found: dict[str, Any] = {}
    for folder in options.datasets:
        entry = found.setdefault(open_dataset(folder).name, {})
        for number in range(options.rounds):
            for name in options.inputs:
                for version in VERSIONS if number % 2 == 0 else VERSIONS[::-1]:
                    turn = _turn(commands[version], folder, name, options.frames[1:])
                    print(folder.name, name, version, turn["peak_mb"], file=sys.stderr)
                    entry.setdefault(name, {}).setdefault(version, []).append(turn)
    about = surroundings(("numpy", "numba", "gtsam", "onnxruntime")) | {"usable_cores": usable_cores()}
    write_results(options.results, "replayed", {"about": about, **found}, page)


def _turn(version: Path, folder: Path, name: str, frames: str) -> dict[str, Any]:
    """One run of one version in a process of its own; waits as percentiles."""
    words = ["--input", "64" if name == "64" else "enriched", *INPUTS[name]]
    words += ["--frames", frames] if frames else []
    words += ["--rate", "0"] if name in UNPACED else []
    words += ["--stages", str(STAGES)] if name == "64" else []
    with tempfile.TemporaryDirectory() as out:
        command = [str(version.with_name("python")), str(RUN), str(folder.absolute()), f"{out}/run", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=out)
    if done.returncode:
        raise InputError(f"{version}: the run failed: {done.stderr.strip().splitlines()[-1:]}")
    turn: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    for key in ("begins_ms", "ends_ms"):
        if key in turn:
            turn[key] = np.percentile(turn[key][WARM_UP:], (50, 95, 99)).round(1).tolist()
    return turn


def _median(turns: Sequence[Mapping[str, Any]], *path: Any) -> float:
    """Median of a figure over the rounds."""
    values = []
    for turn in turns:
        value: Any = turn
        for key in path:
            value = value[key]
        values.append(value)
    return statistics.median(values)


def page(found: Mapping[str, Any]) -> str:
    """The Markdown page of the JSON file."""
    about = found["about"]
    waits, memory, stages = [], [], []
    for sequence, inputs in found.items():
        if sequence == "about":
            continue
        for name, both in inputs.items():
            before, after = (both[version] for version in VERSIONS)
            limit = MAX_PEAK_LIFT if name == "lift" else MAX_PEAK
            peaks = [_median(turns, "peak_mb") for turns in (before, after)]
            ratio = f"{peaks[1] / peaks[0]:.2f}"
            memory.append((sequence, name, *(f"{peak:.0f}" for peak in peaks), ratio, verdict(peaks[1], "<=", limit)))
            if "begins_ms" in after[0]:
                begins = [[_median(turns, "begins_ms", at) for at in range(3)] for turns in (before, after)]
                ends = [[_median(turns, "ends_ms", at) for at in range(3)] for turns in (before, after)]
                cells = [" / ".join(f"{value:.0f}" for value in each) for each in (*begins, *ends)]
                waits.append((sequence, name, *cells, verdict(begins[1][2], "<=", MAX_WAIT)))
            if "stages" in after[0]:
                same = before[0]["stages"]["bytes"] == after[0]["stages"]["bytes"]
                for stage, words in (("gathering_ms", "gathering"), ("map_ms", "map")):
                    times = [_median(turns, "stages", stage) for turns in (before, after)]
                    share = times[1] / times[0]
                    cells = [f"{value:.1f}" for value in times]
                    verdicts = (f"{share:.2f}", verdict(share, "<=", MAX_RATIO), "same" if same else "differ")
                    stages.append((sequence, words, *cells, *verdicts))
    return f"""# Mapping behind the odometry

{about["date"]}, {about["cpu"]}, {about["usable_cores"]} cores, load average {about["load_average"]} at the end.
`{about["command"]}`

Two versions take turns; medians over the rounds.

## Waits of the odometry, scans at 10 Hz

Milliseconds from the time at which a scan is due to the beginning of its front end, and to the end of its odometry:
median / 95th / 99th percentile, without the first {WARM_UP} scans. The run writes session and snapshots as always.
Target: the 99th percentile of the beginning at most {MAX_WAIT:.0f} ms.

{table(("sequence", "input", "begins, before", "begins, after", "ends, before", "ends, after", "target"), waits, 2)}
## Peak memory of a run [MB]

Of the whole process, with imports, map, picture and report.
Target: at most {MAX_PEAK:.0f}, with Lift {MAX_PEAK_LIFT:.0f}.

{table(("sequence", "input", "before", "after", "ratio", "target"), memory, 2)}
## Time of the stages

Processor milliseconds per keyframe in one thread, over the first {STAGES} scans, at the run's poses: gathering (colours
with the reading of the image, averages per voxel, range image, packing), and the map (insertion, moving objects).
Target: half. Bytes of keyframes and map: compared between the versions.

{table(("sequence", "stage", "before", "after", "ratio", "target", "bytes"), stages, 2)}"""


if __name__ == "__main__":
    run_script(main)
