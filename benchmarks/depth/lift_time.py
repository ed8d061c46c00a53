"""Run time of Lift per scan, computing its input included: this version and an earlier one, on one core and on two.

    python -m benchmarks.depth.lift_time kitti_raw_0005 --before VENV/bin/lidarlift

The command is that of an earlier version. The versions are measured in turns, each time in a process of its own, bound
to one core or two; writes lift_time.md and .json in benchmarks/results.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time, sleep
from typing import Any

import numpy as np

from enrichment.geometry.held_out import hold_out, past_of
from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from enrichment.lift.features import lift_input
from enrichment.methods.lift import LiftMethod
from slam.data.cloud import HISTORY, Array
from slam.data.dataset import Dataset, open_dataset

SCANS, REPEATS = 20, 3  # spread over a drive, and how often each
PAUSE = 0.02  # s before each measurement: threads of the one before end
WITH, WITHOUT = "with image", "without image"
INPUT, NETWORK, BOTH = "input", "network", "both"
BEFORE, AFTER = "before", "after"
ROUNDS, CORES = 2, (1, 2)
WORKER = "--worker"


def main() -> None:
    from benchmarks.common.page import surroundings, write_results
    from benchmarks.common.script import add_results, parser

    arguments = parser(__doc__)
    arguments.add_argument("dataset", type=Path, metavar="DATASET")
    arguments.add_argument("--before", type=Path, required=True, metavar="LIDARLIFT")
    add_results(arguments)
    options = arguments.parse_args()
    pythons = {BEFORE: options.before.absolute().with_name("python"), AFTER: Path(sys.executable)}
    rounds: dict[int, dict[str, list[Any]]] = {cores: {name: [] for name in pythons} for cores in CORES}
    for _ in range(ROUNDS):
        for cores, found in rounds.items():
            for name, python in pythons.items():
                found[name].append(_measured(python, options.dataset.absolute(), cores))
    about = surroundings(("numpy", "numba", "onnxruntime"))
    results = {"about": about, "drive": open_dataset(options.dataset).name, "rounds": rounds}
    write_results(options.results, "lift_time", json.loads(json.dumps(results)), page)


def _measured(python: Path, dataset: Path, cores: int) -> Any:
    """Run this file with the packages of a version, bound to some cores."""
    allowed = ",".join(map(str, sorted(os.sched_getaffinity(0))[-cores:]))
    command = ["taskset", "-c", allowed, str(python), __file__, WORKER, str(dataset)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=os.environ | {"PYTHONPATH": ""})
    return json.loads(done.stdout.splitlines()[-1])


def timed(data: Dataset, lift: Method) -> dict[str, dict[str, list[float]]]:
    """Measure milliseconds per scan by view, for input, network and both: elapsed time, its minimum, processor time.

    They are medians over SCANS. Each scan counts with the median of REPEATS and with their minimum, which other
    processes disturb less.
    """
    assert data.sensor is not None
    grid, positions = RayGrid(data.sensor), np.linspace(HISTORY, len(data) - 1, SCANS).astype(int)
    parts: tuple[Callable[[SparseScan, RayGrid], object], ...] = (lift_input, lift)
    seconds = {view: np.zeros((len(parts), SCANS, REPEATS, 2)) for view in (WITHOUT, WITH)}
    for index, position in enumerate(positions):
        scan = hold_out(data[position], grid, past=past_of(data, position)).scan
        views = {WITHOUT: replace(scan, read_image=lambda: None), WITH: scan}
        if index == 0:
            lift(scan, grid)  # compiles
        for repeat in range(REPEATS):
            for view, seen in views.items():
                for part, function in enumerate(parts):
                    given = replace(seen)
                    sleep(PAUSE)
                    start = perf_counter(), process_time()
                    function(given, grid)
                    seconds[view][part, index, repeat] = perf_counter() - start[0], process_time() - start[1]
    return {view: _milliseconds(of_view) for view, of_view in seconds.items()}


def _milliseconds(seconds: Array) -> dict[str, list[float]]:
    """Times of input, network and both, from seconds (2, SCANS, REPEATS, 2) of the input and of both."""
    middle, least = np.median(seconds, axis=2), seconds.min(axis=2)
    found = np.stack([middle[..., 0], least[..., 0], middle[..., 1]], axis=-1)
    parts = {INPUT: found[0], NETWORK: found[1] - found[0], BOTH: found[1]}
    return {name: (1e3 * np.median(of_part, axis=0)).tolist() for name, of_part in parts.items()}


def page(found: Mapping[str, Any]) -> str:
    """The text of lift_time.md."""
    from benchmarks.common.page import table

    rows = []
    for bound, of_cores in found["rounds"].items():
        for view in (WITHOUT, WITH):
            for part in (INPUT, BOTH):
                figures = {
                    version: np.mean([one[view][part] for one in ones], axis=0) for version, ones in of_cores.items()
                }
                cells: list[str] = []
                for measure in range(3):
                    before, after = figures[BEFORE][measure], figures[AFTER][measure]
                    cells += [f"{before:.0f}", f"{after:.0f}", f"{after / before:.2f}"]
                rows.append((str(bound), view, part, *cells))
    header = ["cores", "scans", "time of"]
    for name in ("elapsed", "least", "processor"):
        header += [f"{name}: before", AFTER, "ratio"]
    return f"""# Run time of Lift

{found["about"]["date"]}, {found["about"]["cpu"]}, load average {found["about"]["load_average"]}.
`{found["about"]["command"]}`

Milliseconds per scan of {found["drive"]}: computing the input from the scan, {HISTORY} earlier scans and the image,
and the input and the network together. Reading the image does not count. The versions took turns, {ROUNDS} times each,
in processes bound to the cores. Median over {SCANS} scans of the median of {REPEATS} elapsed times each, of the least,
which other processes affect less, and of the processor time of all threads. Target: a third of the time before.

{table(header, rows, words=3)}
"""


if __name__ == "__main__":
    if WORKER in sys.argv:
        print(json.dumps(timed(open_dataset(Path(sys.argv[-1])), LiftMethod())))
    else:
        from benchmarks.common.script import run_script

        run_script(main)
