"""Simulated drives that come back to where they were: the town's loop, and towns along the paths of KITTI 05 to 07."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.common.simulated import ALONG, SPACING, along, simulated
from slam.data.dataset import Dataset
from slam.simulation.simulation import SimulationConfig

DRIVES = ("loop", *ALONG)


def add_drives(parser: argparse.ArgumentParser) -> None:
    """TRAJECTORIES and --drives."""
    parser.add_argument("trajectories", type=Path, help="folder with kitti_05_ground_truth.txt and the others")
    parser.add_argument("--drives", nargs="+", default=DRIVES, choices=DRIVES)


def drive(name: str, trajectories: Path) -> Dataset:
    """LiDAR only, simulated where the cache has it not yet."""
    if name in ALONG:
        return along(name, trajectories)
    return simulated(name, SimulationConfig(spacing=SPACING, camera=False))
