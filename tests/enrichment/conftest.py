"""A 64-ring scan of a plane ground and a wall across, exact and without noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data.cloud import Array, PointCloud
from slam.data.sensor import Sensor, load_sensor

HEIGHT, WALL = 1.7, 15.0  # m


@pytest.fixture(scope="session")
def grid() -> RayGrid:
    return RayGrid(load_sensor("hdl64"))


def _street(sensor: Sensor, azimuth: Array) -> PointCloud:
    """Every ray's return: from the ground z = -HEIGHT or the wall x = WALL, the nearer; none from the sky."""
    ring, angle = np.repeat(np.arange(sensor.ring_count), len(azimuth)), np.tile(azimuth, sensor.ring_count)
    tangent, offset = np.tan(sensor.elevation)[ring], sensor.offset[ring]
    with np.errstate(divide="ignore"):
        ground = np.where(tangent < 0, (-HEIGHT - offset) / tangent, np.inf)
        wall = np.where(np.cos(angle) > 0, WALL / np.cos(angle), np.inf)
    rho = np.minimum(ground, wall)
    hit = rho < 80
    rho, angle, ring = rho[hit], angle[hit], ring[hit]
    xyz = np.column_stack([rho * np.cos(angle), rho * np.sin(angle), np.tan(sensor.elevation)[ring] * rho])
    xyz[:, 2] += sensor.offset[ring]
    return PointCloud(xyz, np.linspace(0, 1, len(xyz)), ring=ring, time=0.1 * angle / (2 * np.pi))


@pytest.fixture(scope="session")
def street() -> Callable[[Sensor, Array], PointCloud]:
    """`street(sensor, azimuth)`: the scan of it."""
    return _street


@pytest.fixture(scope="session")
def dense(grid: RayGrid) -> PointCloud:
    return _street(grid.sensor, grid.azimuth)


@pytest.fixture(scope="session")
def sparse(dense: PointCloud, grid: RayGrid) -> Callable[..., SparseScan]:
    """`sparse(phase)`: every fourth ring of it."""

    def scan(phase: int = 0) -> SparseScan:
        rings = np.arange(64)
        return SparseScan(dense, grid.sensor, rings).without(rings[rings % 4 != phase])

    return scan
