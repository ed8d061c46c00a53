"""A report of three runs with loops, maps and a scan, made of random points, and of a trajectory of another system."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eval.report.content import report_of
from eval.report.scan import Scan, save_scan
from eval.report.writing import write_report
from eval.runs import Track
from slam.data.cloud import Calibration, PointCloud
from slam.data.point_writer import write_points

CAMERA = np.array([[0, -1.0, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
LENGTHS = {"16": 103.0, "enriched": 101.0, "64": 100.5}
HOSTILE = "<b>&\"it's</b>"  # a label as a file name may be


@pytest.fixture(scope="session")
def cloud() -> Callable[..., PointCloud]:
    """`cloud(1000)`: ground and two walls along 100 m of road, partly seen by a camera; every other point measured."""

    def make(count: int, seed: int = 0) -> PointCloud:
        rng = np.random.default_rng(seed)
        xyz = rng.uniform([-10, -12, -1.7], [110, 12, -1.7], (count, 3)) + rng.normal(0, 0.01, (count, 3))
        wall = rng.random(count) < 0.4
        xyz[wall, 1] = np.where(rng.random(wall.sum()) < 0.5, -12, 12)
        xyz[wall, 2] = rng.uniform(-1.7, 6, wall.sum())
        colour = rng.integers(1, 256, (count, 3)) * (rng.random(count) < 0.7)[:, None]
        measured, sigma = np.arange(count) % 2 == 0, rng.uniform(0.02, 0.5, count)
        return PointCloud(xyz, rng.random(count), colour=colour, measured=measured, sigma=sigma)

    return make


@pytest.fixture(scope="session")
def written(
    tmp_path_factory: pytest.TempPathFactory, write_run: Callable[..., Path], cloud: Callable[..., PointCloud]
) -> Path:
    """The folder of the report."""
    folder = tmp_path_factory.mktemp("compared")
    image = np.random.default_rng(0).integers(0, 256, (60, 200, 3)).astype(np.uint8)
    camera = Calibration(np.array([[100.0, 0, 100], [0, 100, 30], [0, 0, 1]]), CAMERA)
    for seed, (label, length) in enumerate(LENGTHS.items()):
        write_run(folder / label, length)
        write_points(folder / label / "map.pcd", cloud(3000, seed))
        save_scan(folder / label, Scan(50, cloud(2000, seed), image, camera))
    theirs = np.tile(np.eye(4), (101, 1, 1))
    theirs[:, 0, 3] = np.linspace(0, 102, 101)
    folders = {label: folder / label for label in LENGTHS}
    report = report_of("Street <1>", folders, {HOSTILE: Track(theirs, np.arange(101.0))}, "lidarlift compare street")
    write_report(folder, report)
    return folder
