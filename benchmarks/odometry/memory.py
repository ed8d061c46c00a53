"""Peak memory of one system at 64 channels, scans read one by one, and what imports took of it, as JSON.

    python -m benchmarks.odometry.memory SYSTEM SEQUENCE

A process of its own for each system: frame_rate.py starts them. Libraries that the system does not need stay out of it.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

from benchmarks.common.script import parser, run_script
from benchmarks.odometry.drive_arguments import add_drives, as_slice
from benchmarks.odometry.names import SYSTEMS
from benchmarks.odometry.systems import build
from slam.data.dataset import open_dataset


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("system", choices=SYSTEMS)
    add_drives(arguments)
    options = arguments.parse_args()
    pin_to_one_core()
    (drive,) = options.datasets
    dataset = open_dataset(drive)
    system = build(options.system, "64", dataset)
    if options.system == "point-to-plane":
        import open3d  # noqa: F401  # its share belongs to the imports
    before = _peak_mb()
    for position in range(len(dataset))[as_slice(options.frames)]:
        frame = dataset[position]
        system.register(frame.cloud, frame.stamp)
    print(json.dumps({"memory_mb": _peak_mb(), "memory_before_first_scan_mb": before}))


def _peak_mb() -> float:
    """Return the peak memory of this process [MB]; getrusage's ru_maxrss would start at the peak of its parent."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    kilobytes = next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(kilobytes) * 1024 / 1e6


if __name__ == "__main__":
    run_script(main)
