"""Scans of garbage: they fail, the prediction is kept, and nothing of them enters the map, from the second scan on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slam.config import load_config
from slam.consistency import conflicts, range_change, range_shares
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.odometry import Odometry

FRAMES, STEP = 16, 0.6  # m a scan
LENGTH = 120.0  # m


@pytest.fixture(scope="module")
def town() -> list[tuple[Array, Array]]:
    """Walls as corners (2,) and (2,) on both sides of a street, at different distances and with gaps."""
    rng = np.random.default_rng(3)
    walls = []
    for side in (-1, 1):
        at = -60.0
        while at < LENGTH:
            length, depth = rng.uniform(6, 18), rng.uniform(5, 12)
            corners = np.array([[at, 30], [at, depth], [at + length, depth], [at + length, 30]]) * [1, side]
            walls += [(corners[k], corners[k + 1]) for k in range(3)]
            at += length + rng.uniform(2, 12)
    return walls


def scan(walls: list[tuple[Array, Array]], x: float, rng: np.random.Generator) -> PointCloud:
    """What a LiDAR of 16 rings sees at (x, 0, 1.8): walls without end above, and the ground."""
    azimuth = np.deg2rad(np.arange(0, 360, 0.4))
    ray = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    wall = np.full(len(azimuth), 90.0)
    for a, b in walls:
        along, start = b - a, a - [x, 0.0]
        cross = ray[:, 0] * along[1] - ray[:, 1] * along[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (start[0] * along[1] - start[1] * along[0]) / cross
            share = (start[0] * ray[:, 1] - start[1] * ray[:, 0]) / cross
        hit = (distance > 0) & (share >= 0) & (share <= 1)
        wall = np.where(hit & (distance < wall), distance, wall)
    elevation = np.deg2rad(np.arange(-15, 16, 2.0))[:, None]
    ground = np.where(elevation < 0, 1.8 / np.tan(-np.minimum(elevation, -1e-6)), np.inf)
    flat = np.minimum(wall, ground) + rng.normal(0, 0.02, (len(elevation), len(azimuth)))
    points = np.stack([flat * ray[:, 0], flat * ray[:, 1], flat * np.tan(elevation)], axis=-1).reshape(-1, 3)
    points = points[flat.ravel() < 89]
    return PointCloud(points, np.zeros(len(points)))


def random_bytes(xyz: Array) -> Array:
    with np.errstate(invalid="ignore"):
        values = np.frombuffer(np.random.default_rng(1).bytes(xyz.nbytes), np.float32).reshape(-1, 3)
        return values[(np.abs(values) < 1e4).all(axis=1)]


GARBAGE: dict[str, Callable[[Array], Array]] = {
    "random bytes": random_bytes,
    "x and y swapped": lambda xyz: xyz[:, [1, 0, 2]],
    "x reflected": lambda xyz: xyz * [-1, 1, 1],
    "y reflected": lambda xyz: xyz * [1, -1, 1],
}


@pytest.fixture(scope="module")
def scans(town: list[tuple[Array, Array]]) -> list[PointCloud]:
    rng = np.random.default_rng(4)
    return [scan(town, STEP * number, rng) for number in range(FRAMES)]


def test_sound_scans_agree_from_the_first_on(scans: list[PointCloud]) -> None:
    odometry = Odometry(load_config().odometry)
    steps = [odometry.register(cloud, 0.1 * number) for number, cloud in enumerate(scans)]
    assert {step.status for step in steps} == {"registered"}
    assert steps[-1].pose[0, 3] == pytest.approx(STEP * (FRAMES - 1), abs=0.1)


@pytest.mark.parametrize("kind", GARBAGE)
@pytest.mark.parametrize("at", [1, 2, 4, 7, 8, 12])
def test_garbage_fails(kind: str, at: int, scans: list[PointCloud]) -> None:
    odometry = Odometry(load_config().odometry)
    statuses, pose = [], np.eye(4)
    for number, cloud in enumerate(scans):
        if number == at:
            points = np.ascontiguousarray(GARBAGE[kind](cloud.xyz), np.float32)
            cloud = PointCloud(points, np.zeros(len(points)))
        step = odometry.register(cloud, 0.1 * number)
        statuses.append(step.status)
        pose = step.pose
    assert statuses[at] == "failed"
    assert "failed" not in statuses[:at] + statuses[at + 1 :]
    assert np.linalg.norm(pose[:3, 3] - [STEP * (FRAMES - 1), 0, 0]) < 0.15


def test_conflicts_are_points_where_another_scan_looked_through() -> None:
    azimuth = np.deg2rad(np.arange(0, 360, 1.0))
    around = np.column_stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), np.zeros(360)])
    assert conflicts(around, around, np.eye(4)) == 0
    assert conflicts(around, 0.8 * around, np.eye(4)) == 1
    assert conflicts(around, 1.5 * around, np.eye(4)) == 0  # behind what was seen
    assert conflicts(around, np.array([[0.0, 0.0, 8.0]]), np.eye(4)) == 0  # where nothing was seen
    assert conflicts(around, around, se3.exp(np.array([0, 0, 0, 3.0, 0, 0]))) == pytest.approx(0.3, abs=0.05)


def test_the_change_of_the_ranges_does_not_depend_on_the_number_of_points() -> None:
    points = np.array([[1.0, 0, 0], [6.0, 0, 0], [30.0, 0, 0], [90.0, 0, 0]])
    assert range_change(range_shares(points), range_shares(np.tile(points, (5, 1)))) == 0
    assert range_change(range_shares(points), range_shares(points[:2])) == pytest.approx(0.5)


def vehicles(x: float) -> list[tuple[Array, Array]]:
    """The sides of lorries around a car at x, which drive as fast as it does."""
    sides = []
    for ahead, left in ((12.0, -1.2), (-16.0, -1.2), (3.0, 3.2), (-9.0, 3.4), (16.0, 3.3)):
        a, b, c, d = (
            np.array([x + ahead + along, left + across]) for along, across in ((0, 0), (6, 0), (6, 2.4), (0, 2.4))
        )
        sides += [(a, b), (b, c), (c, d), (d, a)]
    return sides


def test_vehicles_that_keep_their_distance_do_not_refute_the_motion(town: list[tuple[Array, Array]]) -> None:
    """They stand where the scan before looked through, unless the car stood still."""
    odometry, rng = Odometry(load_config().odometry), np.random.default_rng(5)
    places = 1.0 * np.arange(FRAMES)
    for number, x in enumerate(places):
        pose = odometry.register(scan(town + vehicles(x), x, rng), 0.1 * number).pose
    assert pose[0, 3] == pytest.approx(places[-1], abs=0.2)
