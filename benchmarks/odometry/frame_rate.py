"""Odometry compared with its peers on the same scans: speed, accuracy, memory.

    python -m benchmarks.odometry.frame_rate SEQUENCE [SEQUENCE ...]

writes frame_rate.md, .json and .png in benchmarks/results. The JSON is [dataset][system][channels].{median_ms, ate_m,
...}, with "about" beside the data sets. Linux only (pins to a core).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD, output_of, pin_to_one_core

os.environ.update(ONE_THREAD)

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.odometry.comparison import Memory, compare
from benchmarks.odometry.dense import dense_trajectory
from benchmarks.odometry.drive_arguments import add_drives, as_slice
from benchmarks.odometry.frame_rate_page import page
from benchmarks.odometry.frame_rate_picture import draw
from benchmarks.odometry.measure import UNCOUNTED
from benchmarks.odometry.names import SYSTEMS

PACKAGES = ("numpy", "numba", "kiss-icp", "small_gicp", "open3d")


def main() -> None:
    arguments = _arguments()
    about = surroundings(PACKAGES) | {"datasets": {}, "repeats": arguments.repeats, "uncounted": UNCOUNTED}
    results: dict[str, Any] = {}
    alone = [(dense_trajectory(path, arguments.frames), _memory(path, arguments.frames)) for path in arguments.datasets]
    pin_to_one_core()
    for path, apart in zip(arguments.datasets, alone, strict=True):
        name, entries, facts = compare(path, as_slice(arguments.frames), arguments.repeats, *apart)
        results[name], about["datasets"][name] = entries, facts
    write_results(arguments.results, "frame_rate", {"about": about, **results}, page)
    draw(results, arguments.results / "frame_rate.png")


def _memory(path: Path, frames: str) -> Memory:
    """Memory of each system, in a process of its own; empty if it failed (stderr says why)."""
    print(f"{path.name}: memory", file=sys.stderr)
    printed = {name: output_of("benchmarks.odometry.memory", name, str(path), f"--frames={frames}") for name in SYSTEMS}
    return {name: json.loads(text) if text else {} for name, text in printed.items()}


def _arguments() -> argparse.Namespace:
    arguments = parser(__doc__)
    add_drives(arguments)
    arguments.add_argument("--repeats", type=int, default=3, metavar="N")
    add_results(arguments)
    return arguments.parse_args()


if __name__ == "__main__":
    run_script(main)
