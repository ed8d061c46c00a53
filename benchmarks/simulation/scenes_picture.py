"""Draws the simulated scenes into one picture: what the camera sees, a scan as a range image, and a map.

    python -m benchmarks.simulation.scenes_picture docs/scenes.jpg

A row for each scene. The map has scans from all over the drive, each placed by its true pose, seen from above and
coloured by height: what stands is sharp in it where truth and scans agree.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib
import numpy as np

from benchmarks.common.script import parser, run_script
from slam.data.cloud import Array
from slam.simulation.lidar import Scan
from slam.simulation.simulation import Simulation, SimulationConfig


@dataclass(frozen=True)
class Row:
    """A drive, by which LiDAR, the frame whose image and scan are shown, and metres that a pixel of the map covers."""

    drive: str
    sensor: str
    frame: int
    pixel: float = 0.25


ROWS = (
    Row("crawl", "hdl64", 150, 0.15),
    Row("motorway", "hdl64", 76, 0.4),
    Row("bridge", "hdl64", 100),
    Row("tunnel", "hdl64", 130),
    Row("lorries", "vls128", 60),
    Row("traffic", "os1-64", 120),
    Row("building", "vlp16", 160, 0.06),
)
WIDTH, HEIGHT, GAP = 620, 187, 6  # pixels of a panel, and between panels
COLUMNS, FARTHEST, SCANS = 1024, 60.0, 40  # of a range image, and m of its colours; scans of a map


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("picture", type=Path, help=".jpg or .png to write")
    options = arguments.parse_args()
    rows = []
    for row in ROWS:
        print(f"{row.drive}, {row.sensor}", file=sys.stderr)
        rows.append(np.hstack([_framed(panel) for panel in panels(row)]))
    cv2.imwrite(str(options.picture), np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


def panels(row: Row) -> tuple[Array, Array, Array]:
    """Camera image, range image and map, RGB uint8."""
    settings = SimulationConfig(row.drive, sensor=row.sensor)
    rig = Simulation(settings).rig
    frame = rig.frame(row.frame)
    assert frame.image is not None
    still = Simulation(SimulationConfig(row.drive, sensor=row.sensor, camera=False)).rig
    numbers = np.unique(np.linspace(0, len(still.poses) - 1, SCANS).astype(int))
    placed = []
    for number in numbers:
        rotation, position = still.poses[number, :3, :3], still.poses[number, :3, 3]
        placed.append(still.frame(number).scan.xyz @ rotation.T + position)
    rings = rig.lidar.sensor.ring_count
    return frame.image, range_image(frame.scan, rings), map_image(np.concatenate(placed), row.pixel)


def range_image(scan: Scan, rings: int) -> Array:
    """Ranges by ring and azimuth, ahead in the middle, the rear at both ends; black where nothing came back."""
    reach = np.linalg.norm(scan.xyz, axis=1)
    azimuth = np.arctan2(scan.xyz[:, 1], scan.xyz[:, 0])
    column = ((0.5 - azimuth / (2 * np.pi)) * COLUMNS).astype(int) % COLUMNS
    image = np.zeros((rings, COLUMNS, 3))
    image[scan.ring, column] = matplotlib.colormaps["turbo"](1 - np.minimum(reach / FARTHEST, 1) ** 0.5)[:, :3]
    tall = np.repeat(image, max(round(HEIGHT / rings), 1), axis=0)
    return np.asarray(np.round(255 * tall), np.uint8)


def map_image(points: Array, pixel: float) -> Array:
    """From above, as much as a panel shows around the middle; brighter where more points are, coloured by height."""
    middle = np.median(points[:, :2], axis=0)
    turn = np.linalg.svd((points[::50, :2] - middle), full_matrices=False)[2]  # the long side across the panel
    flat = (points[:, :2] - middle) @ turn.T / pixel + np.array([WIDTH, HEIGHT]) / 2
    inside = ((flat >= 0) & (flat < [WIDTH, HEIGHT])).all(axis=1)
    u, v = flat[inside].astype(int).T
    cell = v * WIDTH + u
    count = np.bincount(cell, minlength=WIDTH * HEIGHT)
    height = np.bincount(cell, points[inside, 2], WIDTH * HEIGHT) / np.maximum(count, 1)
    low, high = np.percentile(height[count > 0], [5, 95])
    colour = matplotlib.colormaps["viridis"](np.clip((height - low) / (high - low + 1e-9), 0, 1))[:, :3]
    bright = np.minimum(np.log1p(count) / np.log1p(np.percentile(count[count > 0], 90)), 1)
    return np.asarray(np.round(255 * colour * bright[:, None]), np.uint8).reshape(HEIGHT, WIDTH, 3)


def _framed(image: Array) -> Array:
    """Scaled to a panel, white around it."""
    panel = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return cv2.copyMakeBorder(panel, 0, GAP, 0, GAP, cv2.BORDER_CONSTANT, value=(255, 255, 255))


if __name__ == "__main__":
    run_script(main)
