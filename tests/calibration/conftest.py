"""A street of boxes that a LiDAR and a camera drive through, with exact extrinsics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.calibration.observations import View, view_of
from slam.data import se3
from slam.data.calibration_file import calibration_text
from slam.data.cloud import Array, Calibration, PointCloud

K = np.array([[300.0, 0.0, 240.0], [0.0, 300.0, 75.0], [0.0, 0.0, 1.0]])
T_CAMERA_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.15], [1, 0, 0, -0.25], [0, 0, 0, 1.0]])
ROWS, COLUMNS = 150, 480
RINGS, AZIMUTHS = 40, 360  # in 100 degrees ahead
GROUND, FAR = -1.7, 80.0  # m


@dataclass(frozen=True)
class Street:
    """Boxes (B, 6), lowest and highest corner [m], and their shades (B,) 0..255."""

    boxes: Array
    shades: Array

    def hits(self, origin: Array, rays: Array) -> tuple[Array, Array]:
        """Distance (N,) along each unit ray, inf for none, and the shade (N,) there; the ground has marks."""
        with np.errstate(divide="ignore"):
            inverse = 1 / rays
        low = (self.boxes[None, :, :3] - origin) * inverse[:, None]
        high = (self.boxes[None, :, 3:] - origin) * inverse[:, None]
        enter, leave = np.minimum(low, high).max(axis=2), np.maximum(low, high).min(axis=2)
        distance = np.where((enter > 0) & (enter < leave), enter, np.inf)
        first = distance.argmin(axis=1)
        nearest, shade = distance[np.arange(len(rays)), first], self.shades[first]
        ground = np.where(rays[:, 2] < 0, (GROUND - origin[2]) * inverse[:, 2], np.inf)
        x, y = (origin[:2] + np.minimum(ground, FAR)[:, None] * rays[:, :2]).T
        marked = (np.abs(np.abs(y) - 2.0) < 0.12) & (np.mod(x, 6.0) < 3.0)
        shade = np.where(ground < nearest, np.where(marked, 230, 90), shade)
        nearest = np.minimum(nearest, ground)
        return np.where(nearest < FAR, nearest, np.inf), np.where(nearest < FAR, shade, 200)

    def scan(self, T_world_lidar: Array) -> PointCloud:
        elevation = np.deg2rad(np.linspace(2, -20, RINGS))
        azimuth = np.deg2rad(np.linspace(-50, 50, AZIMUTHS))
        ring, turn = (grid.ravel() for grid in np.meshgrid(np.arange(RINGS), azimuth, indexing="ij"))
        flat = np.cos(elevation[ring])
        rays = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), np.sin(elevation[ring])])
        distance, shade = self.hits(T_world_lidar[:3, 3], rays @ T_world_lidar[:3, :3].T)
        there = np.isfinite(distance)
        return PointCloud((rays * np.where(there, distance, 0)[:, None])[there], shade[there] / 255, ring[there])

    def image(self, T_world_lidar: Array) -> Array:
        T = T_world_lidar @ se3.inverse(T_CAMERA_LIDAR)
        column, row = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
        rays = np.linalg.solve(K, np.stack([column.ravel(), row.ravel(), np.ones(column.size)])).T @ T[:3, :3].T
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        shade = self.hits(T[:3, 3], rays)[1].reshape(ROWS, COLUMNS).astype(np.uint8)
        return np.repeat(shade[:, :, None], 3, axis=2)


@pytest.fixture(scope="session")
def street() -> Street:
    rng = np.random.default_rng(3)
    boxes, shades = [], []
    for x in np.arange(4.0, 50.0, 4.0):
        for side in (-1, 1):
            y, wide, long, high = side * rng.uniform(4, 9), *rng.uniform([0.3, 0.3, 0.6], [1.2, 1.5, 4.0])
            boxes.append([x, y - wide / 2, GROUND, x + long, y + wide / 2, GROUND + high])
            shades.append(rng.integers(10, 80))
    for side in (-1, 1):
        boxes.append([-20.0, side * 14.0 - 0.5, GROUND, 120.0, side * 14.0 + 0.5, 6.0])
        shades.append(150)
    return Street(np.array(boxes), np.array(shades))


def poses(count: int) -> Array:
    """T_world_lidar (N, 4, 4) at 0.1 s: 7 m/s along the street, turning left at 14 deg/s."""
    heading = 0.025 * np.arange(count) - 0.14
    found = np.array([se3.exp(np.array([0.0, 0.0, angle, 0.0, 0.0, 0.0])) for angle in heading])
    found[:, 0, 3] = 0.7 * np.arange(count)
    return found


@pytest.fixture(scope="session")
def views(street: Street) -> list[View]:
    """Twelve views; the images are taken at the scans' stamps."""
    track = poses(12)
    found = []
    for at, T in enumerate(track):
        before, after = max(at - 1, 0), min(at + 1, len(track) - 1)
        velocity = se3.log(se3.inverse(track[before]) @ track[after]) / (0.1 * (after - before))
        found.append(view_of(street.scan(T), velocity, cv2.cvtColor(street.image(T), cv2.COLOR_RGB2GRAY)))
    return found


def pcd(cloud: PointCloud) -> bytes:
    """A binary PCD with intensity and ring."""
    assert cloud.ring is not None
    columns = [cloud.xyz, cloud.intensity[:, None], cloud.ring[:, None]]
    head = "VERSION .7\nFIELDS x y z intensity ring\nSIZE 4 4 4 4 4\nTYPE F F F F F\nCOUNT 1 1 1 1 1\n"
    size = f"WIDTH {len(cloud)}\nHEIGHT 1\nPOINTS {len(cloud)}\nDATA binary\n"
    return (head + size).encode() + np.hstack(columns).astype("<f4").tobytes()


@pytest.fixture(scope="session")
def recorded(street: Street, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a folder of a user: scans, images and calib.yaml."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "images").mkdir()
    for number, T in enumerate(poses(12)):
        (folder / f"{number:06d}.pcd").write_bytes(pcd(street.scan(T)))
        cv2.imwrite(str(folder / "images" / f"{number:06d}.png"), street.image(T))
    (folder / "times.txt").write_text("".join(f"{0.1 * number:.1f}\n" for number in range(12)))
    (folder / "calib.yaml").write_text(calibration_text(Calibration(K, T_CAMERA_LIDAR)))
    return folder


@pytest.fixture(scope="session")
def off() -> Callable[[Array, Array], tuple[float, float]]:
    """Angle [deg] and distance [cm] between two extrinsics."""

    def errors(T: Array, truth: Array) -> tuple[float, float]:
        turned = np.eye(4)
        turned[:3, :3] = T[:3, :3] @ truth[:3, :3].T
        return float(np.rad2deg(se3.angle(turned))), float(100 * np.linalg.norm(T[:3, 3] - truth[:3, 3]))

    return errors
