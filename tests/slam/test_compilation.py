"""Kernels are compiled before the first frame, for the types that a run has."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from slam.compilation import compiling_mapping
from slam.settings import Config

RUN = """
import numpy as np
from numba.core.dispatcher import Dispatcher
from slam.compilation import compile_kernels
from slam.data import kernels as of_data
from slam.data.cloud import Frame, PointCloud
from slam.loops import kernels as of_loops
from slam.mapping import kernels as of_mapping
from slam.registration import kernels as of_registration
from slam.pipeline import Slam
from slam.settings import Config

def compiled():
    rooms = (of_data, of_loops, of_mapping, of_registration)
    kernels = {f"{room.__name__}.{name}": kernel for room in rooms for name, kernel in vars(room).items()}
    return {name: len(kernel.signatures) for name, kernel in kernels.items() if isinstance(kernel, Dispatcher)}

compile_kernels(Config(), lambda: None)
before = compiled()
random = np.random.default_rng(0)
walls = random.uniform((-20, -14, -1.5), (20, 14, 2.5), (6000, 3))
side = random.integers(0, 3, len(walls))
walls[np.arange(len(walls)), side] = np.where(random.random(len(walls)) < 0.5, 1, -1) * np.array([20, 14, 1.5])[side]
with Slam(Config()) as slam:
    for k in range(8):
        time = random.uniform(-0.05, 0.05, len(walls)).astype(np.float32)
        slam.add(Frame(k, 0.1 * k, PointCloud((walls - (0.6 * k, 0, 0)).astype(np.float32), time, time=time)))
    slam.finish()
print(*[name for name, count in compiled().items() if count != before[name]])
"""


def test_a_run_compiles_no_kernel_once_more() -> None:
    """An array with strides or of another type would be compiled for, in the middle of a run."""
    done = subprocess.run([sys.executable, "-c", RUN], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


COLD = """
import os
from pathlib import Path
from slam.compilation import compile_odometry
from slam.registration import compilation
from slam.settings import Config

started = []
start = compilation.start
compilation.start = lambda: started.append(start()) or started[-1]
notified = []
compile_odometry(Config(), lambda: notified.append(1))
kernels = list(Path(os.environ["NUMBA_CACHE_DIR"]).rglob("*.nbi"))
print(len(notified), len(kernels), all(process is None or process.poll() is not None for process in started))
"""


def test_cold_kernels_are_compiled_once_and_told_once(tmp_path: Path) -> None:
    """Two processes fill one cache; the second is gone when all kernels are there."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", COLD], env=environment, capture_output=True, text=True, check=True)
    notified, kernels, ended = done.stdout.split()
    assert notified == "1"
    assert int(kernels) > 10
    assert ended == "True"
    index = {path.name for path in tmp_path.rglob("*.nbi")}
    again = subprocess.run(
        [sys.executable, "-m", "slam.registration.compilation"], env=environment, capture_output=True, check=True
    )
    assert again.stderr == b""
    assert {path.name for path in tmp_path.rglob("*.nbi")} == index


def test_the_thread_ends_with_the_statement() -> None:
    with pytest.raises(KeyboardInterrupt), compiling_mapping(Config()):
        raise KeyboardInterrupt
    assert "compilation" not in {thread.name for thread in threading.enumerate()}
