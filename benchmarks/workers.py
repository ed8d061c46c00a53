"""What is not timed beside the others: peak memory and the dense trajectory, each in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

SCRIPT = Path(__file__).with_name("odometry.py")


def call(mode: Sequence[str], dataset: Path, frames: str) -> str | None:
    """What `odometry.py MODE... DATASET` prints in its own process; None where it fails (stderr says why)."""
    command = [sys.executable, str(SCRIPT), *mode, f"--frames={frames}", str(dataset)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    return done.stdout if done.returncode == 0 else None


def memory(system_name: str, dataset_path: Path, frames: slice) -> None:
    """Print the peak memory of one system at 64 channels with scans read one by one, and what imports took of it."""
    from systems import build

    from slam.data.dataset import open_dataset

    dataset = open_dataset(dataset_path)
    system = build(system_name, "64", dataset)
    if system_name == "point-to-plane":
        import open3d  # noqa: F401  # its share belongs to the imports
    before = _peak_mb()
    for position in range(len(dataset))[frames]:
        frame = dataset[position]
        system.register(frame.cloud, frame.stamp)
    print(json.dumps({"memory_mb": _peak_mb(), "memory_before_first_scan_mb": before}))


def dense(file: Path, dataset_path: Path, frames: slice) -> None:
    """Write the trajectory of the dense yardstick (N, 4, 4), at 64 channels, as .npy."""
    import numpy as np
    from peers import DenseGicp
    from systems import vertical_correction

    from slam.data.dataset import open_dataset

    dataset = open_dataset(dataset_path)
    system = DenseGicp(vertical_correction(dataset))
    poses = [system.register(dataset[position].cloud) for position in range(len(dataset))[frames]]
    np.save(file, np.array(poses))


def _peak_mb() -> float:
    """Of this program [MB]. Not getrusage's ru_maxrss: that starts at the peak of the process that called this one."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    kilobytes = next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(kilobytes) * 1024 / 1e6
