"""The trajectory of the dense yardstick at 64 channels (N, 4, 4), as .npy.

    python -m benchmarks.odometry.dense FILE.npy DRIVE

frame_rate.py starts it, in a process of its own: it may use more than one thread.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.common.script import parser, run_script
from benchmarks.odometry.drive_arguments import add_drives, as_slice
from benchmarks.odometry.peers import DenseGicp
from benchmarks.odometry.systems import vertical_correction
from slam.data.dataset import open_dataset


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("file", type=Path)
    add_drives(arguments)
    options = arguments.parse_args()
    (drive,) = options.datasets
    dataset = open_dataset(drive)
    system = DenseGicp(vertical_correction(dataset))
    positions = range(len(dataset))[as_slice(options.frames)]
    np.save(options.file, np.array([system.register(dataset[position].cloud) for position in positions]))


if __name__ == "__main__":
    run_script(main)
