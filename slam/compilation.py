"""Compilation of the numba kernels before they are needed, so that the user is told and no frame has to wait.

numba compiles a kernel for the types of its first arguments, and keeps the result on disk. So each function here calls
the kernels as a run calls them, on a few points; with the kernels on disk this takes less than half a second.
"""

from __future__ import annotations

import math
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from numba.core.event import Listener, install_listener

from slam.data.camera import with_colour
from slam.data.cloud import Calibration, PointCloud
from slam.loops.closing import LoopSearch
from slam.loops.scan_context import ScanContext
from slam.loops.verification import Verifier
from slam.mapping.global_map import build_map
from slam.mapping.keyframes import Keyframes
from slam.odometry import Odometry
from slam.registration import compilation as registration
from slam.settings import Config


def compile_kernels(config: Config, notify: Callable[[], None]) -> None:
    """Load all kernels of a run from the disk or compile them; `notify` as in `compile_odometry`."""
    compile_odometry(config, notify)
    for compile_some in _of_mapping(config):
        compile_some()


def compile_odometry(config: Config, notify: Callable[[], None]) -> None:
    """Load the kernels of the odometry from the disk, or call `notify` and compile them, in two processes."""
    helpers: list[subprocess.Popen[bytes] | None] = []

    def begin() -> None:
        notify()
        helpers.append(registration.start())

    with install_listener("numba:compile", _AtFirst(begin)):
        cloud = _cloud()
        odometry = Odometry(config.odometry, vertical_correction=0.01)
        for stamp in (0.0, 0.1, 0.2):
            odometry.register(cloud, stamp)
        assert odometry.target is not None
        odometry.target.evict(np.zeros(3), 1.0)
    for helper in filter(None, helpers):  # what it still compiles is there by now
        helper.kill()
        helper.wait()


class _AtFirst(Listener):
    """Calls a function when the first kernel begins to be compiled; kernels from the disk are not."""

    def __init__(self, call: Callable[[], None]) -> None:
        self._call: Callable[[], None] | None = call

    def on_start(self, event: Any) -> None:
        if self._call:
            call, self._call = self._call, None
            call()

    def on_end(self, event: Any) -> None:
        """Nothing is left to do."""


@contextmanager
def compiling_mapping(config: Config) -> Iterator[None]:
    """Load the kernels of keyframes, loops and map from the disk or compile them in a thread, in a `with` statement.

    The thread ends early if the statement ends before. A kernel that is needed meanwhile waits until it is compiled.
    """
    stopped = threading.Event()

    def work() -> None:
        with suppress(Exception):  # a kernel that does not compile is an error where it is needed
            for compile_some in _of_mapping(config):
                if stopped.is_set():
                    return
                compile_some()

    thread = threading.Thread(target=work, name="compilation")
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


def _of_mapping(config: Config) -> list[Callable[[], object]]:
    """Calls of the kernels of keyframes, loops and map, in the order in which a run needs them."""
    keyframes, search = Keyframes(config.keyframes), LoopSearch(config.loops)

    def add() -> None:
        coloured = with_colour(_cloud(), np.zeros((8, 8, 3), np.uint8), Calibration(np.eye(3), np.eye(4)))
        keyframes.add(coloured, np.eye(4), 0, 0.0)
        keyframes.finish()

    def revisit() -> None:
        places = ScanContext(config.loops.scan_context)
        places.add(_cloud().xyz, 0.0)
        places.query(_cloud().xyz, math.inf)

    return [
        add,
        lambda: search.next(keyframes, []),
        revisit,
        lambda: Verifier(config.loops.verification).verify(keyframes, 0, 0, np.eye(4)),
        lambda: build_map(keyframes, keyframes.poses, config.map),
    ]


def _cloud() -> PointCloud:
    xyz = np.random.default_rng(0).uniform(-10, 10, (200, 3)).astype(np.float32)
    return PointCloud(xyz, np.zeros(200), time=np.zeros(200))
