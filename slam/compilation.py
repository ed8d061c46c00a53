"""Compilation of the numba kernels before a run, so that the first frames are not slow and the user is told."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from slam.data.camera import with_colour
from slam.data.cloud import Calibration, PointCloud
from slam.loops.closing import LoopSearch
from slam.loops.verification import Verifier
from slam.mapping.global_map import build_map
from slam.mapping.keyframes import Keyframes
from slam.odometry import Odometry
from slam.settings import Config


def compile_kernels(config: Config, notify: Callable[[], None]) -> None:
    """Load the numba kernels from the cache or compile them; call `notify` once if this takes more than 1.5 s."""
    timer = threading.Timer(1.5, notify)
    timer.start()
    try:
        random = np.random.default_rng(0)
        xyz = random.uniform(-10, 10, (2000, 3)).astype(np.float32)
        cloud = PointCloud(xyz, np.zeros(2000), time=np.zeros(2000))
        odometry = Odometry(config.odometry, vertical_correction=0.01)
        for stamp in (0.0, 0.1, 0.2):
            odometry.register(cloud, stamp)
        assert odometry.target is not None
        odometry.target.evict(np.zeros(3), 1.0)
        coloured = with_colour(cloud, np.zeros((8, 8, 3), np.uint8), Calibration(np.eye(3), np.eye(4)))
        keyframes = Keyframes(config.keyframes)
        keyframes.add(coloured, np.eye(4), 0, 0.0)
        keyframes.finish()
        search = LoopSearch(config.loops)
        search.next(keyframes)
        Verifier(config.loops.verification).verify(keyframes, 0, 0, np.eye(4))
        build_map(keyframes, keyframes.poses, config.map)
    finally:
        timer.cancel()
