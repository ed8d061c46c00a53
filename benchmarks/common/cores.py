"""One core and one thread, for figures that do not depend on how many there are. Imports nothing that starts threads.

os.environ.update(ONE_THREAD)     stands before the import of numpy: its libraries read these variables only once
"""

from __future__ import annotations

import os
import subprocess
import sys

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "TBB_NUM_THREADS"), "1"
)


def pin_to_one_core() -> None:
    """This process and those that it starts, on Linux."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def output_of(module: str, *words: str) -> str | None:
    """Run a module in a process of its own without limit of its threads, and return its output; None if it fails."""
    free = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    command = [sys.executable, "-m", module, *words]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=free)
    return done.stdout if done.returncode == 0 else None
