"""Compilation of the kernels that register a scan, in a process of its own: `python -m slam.registration.compilation`.

numba compiles one kernel at a time in each process, and all processes share the cache on the disk.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from slam.data.machine import usable_cores
from slam.registration.ndt import NdtTarget


def compile_registration() -> None:
    """Load the kernels that register a scan from the disk or compile them; those that make the map are left out."""
    xyz, weight = np.ones((1, 3), np.float32), np.ones(1, np.float32)
    NdtTarget((1.5, 1.0), surfaces=True).align(xyz, weight, np.eye(4))


def start() -> subprocess.Popen[bytes] | None:
    """Start the process, which writes into the cache of kernels; None on a single core, where it would not help."""
    if usable_cores() < 2:
        return None
    quiet = subprocess.DEVNULL
    return subprocess.Popen([sys.executable, "-P", "-m", __name__], stdin=quiet, stdout=quiet, stderr=quiet)


if __name__ == "__main__":
    compile_registration()
