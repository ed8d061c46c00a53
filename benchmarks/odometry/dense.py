"""The trajectory of the dense yardstick at 64 channels (N, 4, 4), as .npy.

    python -m benchmarks.odometry.dense FILE.npy SEQUENCE

`dense_trajectory` starts it, in a process of its own: it may use more than one thread.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.common.cores import output_of
from benchmarks.common.script import parser, run_script
from benchmarks.odometry.drive_arguments import add_drives, as_slice
from benchmarks.odometry.systems import vertical_correction
from slam.data.cloud import Array
from slam.data.dataset import open_dataset


def dense_trajectory(drive: Path, frames: str) -> Array | None:
    """(N, 4, 4) of the frames A:B of a drive; None where it fails (stderr says why)."""
    print(f"{drive.name}: dense trajectory", file=sys.stderr)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "dense.npy"
        done = output_of(__name__, str(file), str(drive), f"--frames={frames}")
        return None if done is None else np.asarray(np.load(file))


def main() -> None:
    from benchmarks.odometry.peers import DenseGicp  # here: who starts it may not have small_gicp

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
