"""Processor time of KISS-ICP's odometry alone on all channels of a sequence, as JSON.

    python -m benchmarks.whole.kiss_icp SEQUENCE

A process of its own: whole_run.py starts it. Reading and preparing of the scans does not count, nor do imports.
"""

from __future__ import annotations

import json
import os
import time

from benchmarks.common.cores import ONE_THREAD

os.environ.update(ONE_THREAD)

from benchmarks.common.script import parser, run_script
from benchmarks.odometry.drive_arguments import add_drives, as_slice
from benchmarks.odometry.measure import front_end
from benchmarks.odometry.systems import build
from slam.data.dataset import open_dataset


def main() -> None:
    arguments = parser(__doc__)
    add_drives(arguments)
    options = arguments.parse_args()
    (drive,) = options.datasets
    dataset = open_dataset(drive)
    system, spent, frames = build("kiss-icp", "64", dataset), 0.0, 0
    for position in range(len(dataset))[as_slice(options.frames)]:
        ((cloud, stamp),) = front_end(dataset, [dataset[position]], "64")
        begin = time.process_time()
        system.register(cloud, stamp)
        spent += time.process_time() - begin
        frames += 1
    print(json.dumps({"processor_s": spent, "frames": frames}))


if __name__ == "__main__":
    run_script(main)
