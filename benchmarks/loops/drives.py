"""Simulated drives that come back to where they were: the town's loop, and towns along the paths of KITTI 05 to 07."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.common.simulated import simulated
from slam.data.dataset import Dataset
from slam.simulation.simulation import SimulationConfig

DRIVES = ("loop", "05", "06", "07")
SPACING = 1.5  # m between frames


def add_drives(parser: argparse.ArgumentParser) -> None:
    """TRAJECTORIES and --drives."""
    parser.add_argument("trajectories", type=Path, help="folder with kitti_05_ground_truth.txt and the others")
    parser.add_argument("--drives", nargs="+", default=DRIVES, choices=DRIVES)


def drive(name: str, trajectories: Path) -> Dataset:
    """LiDAR only, simulated where the cache has it not yet."""
    way = None if name == "loop" else trajectories / f"kitti_{name}_ground_truth.txt"
    return simulated(name, SimulationConfig(trajectory=way, spacing=SPACING, camera=False))
