"""Odometry compared with its peers on the same scans: speed, accuracy, memory.

    python -m benchmarks.odometry.frame_rate DRIVE [DRIVE ...]

writes frame_rate.md, .json and .png in benchmarks/results. The JSON is [dataset][system][channels].{median_ms, ate_m,
...}, with "about" beside the data sets. Linux only (pins to a core).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.odometry.comparison import compare
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
    with tempfile.TemporaryDirectory() as folder:
        alone = [_alone(path, arguments.frames, Path(folder) / f"{i}.npy") for i, path in enumerate(arguments.datasets)]
        pin_to_one_core()
        for path, apart in zip(arguments.datasets, alone, strict=True):
            name, entries, facts = compare(path, as_slice(arguments.frames), arguments.repeats, *apart)
            results[name], about["datasets"][name] = entries, facts
    write_results(arguments.results, "frame_rate", {"about": about, **results}, page)
    draw(results, arguments.results / "frame_rate.png")


def _alone(path: Path, frames: str, dense: Path) -> tuple[Path | None, dict[str, dict[str, float]]]:
    """The file of the dense trajectory, None where that failed, and the memory of each system, empty where it did."""
    print(f"{path.name}: dense trajectory and memory, in processes of their own", file=sys.stderr)
    done = _in_own_process("dense", str(dense), path, frames) is not None
    printed = {name: _in_own_process("memory", name, path, frames) for name in SYSTEMS}
    return dense if done else None, {name: json.loads(text) if text else {} for name, text in printed.items()}


def _in_own_process(script: str, what: str, drive: Path, frames: str) -> str | None:
    """What the script prints, whose threads are not limited from here; None where it fails (stderr says why)."""
    words = [sys.executable, "-m", f"benchmarks.odometry.{script}", what, str(drive), f"--frames={frames}"]
    free = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=False, env=free)
    return done.stdout if done.returncode == 0 else None


def _arguments() -> argparse.Namespace:
    arguments = parser(__doc__)
    add_drives(arguments)
    arguments.add_argument("--repeats", type=int, default=3, metavar="N")
    add_results(arguments)
    return arguments.parse_args()


if __name__ == "__main__":
    run_script(main)
