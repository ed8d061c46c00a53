"""Tiny drives to test the loaders on."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.data.sensor import load_sensor

CALIBRATION = """P0: 700 0 600 0 0 700 180 0 0 0 1 0
P2: 700 0 600 42 0 700 180 0 0 0 1 0
Tr: 0 -1 0 0.1 0 0 -1 0.2 1 0 0 0.3
"""

ScanMaker = Callable[..., Array]


@pytest.fixture
def hdl64_scan() -> ScanMaker:
    """A scan (N, 4) as KITTI stores it, ring after ring: `hdl64_scan(rings=range(64), columns=360)`, ranges 5-30 m."""

    def make(rings: Iterable[int] = range(64), columns: int = 360) -> Array:
        sensor, scan = load_sensor("hdl64"), []
        azimuth = (np.arange(columns) + 0.5) / columns * 2 * np.pi
        for ring in rings:
            rho = 15 + 10 * np.sin(azimuth + ring / 7)
            z = np.tan(sensor.elevation[ring]) * rho + sensor.offset[ring]
            scan.append(np.column_stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z, np.full(columns, 0.5)]))
        return np.concatenate(scan).astype(np.float32)

    return make


@pytest.fixture
def odometry_root(tmp_path: Path, hdl64_scan: ScanMaker) -> Path:
    """KITTI odometry with one sequence, 04: scans 0-2 whole, with calibration, times and poses of five frames."""
    folder = tmp_path / "sequences" / "04"
    (folder / "velodyne").mkdir(parents=True)
    for number in range(3):
        hdl64_scan().tofile(folder / "velodyne" / f"{number:06d}.bin")
    (folder / "calib.txt").write_text(CALIBRATION)
    (folder / "times.txt").write_text("".join(f"{0.2 * number:e}\n" for number in range(5)))
    (tmp_path / "poses").mkdir()
    # Camera 0 drives along its z axis, a metre a frame.
    poses = [f"1 0 0 0 0 1 0 0 0 0 1 {number}\n" for number in range(5)]
    (tmp_path / "poses" / "04.txt").write_text("".join(poses))
    return tmp_path
