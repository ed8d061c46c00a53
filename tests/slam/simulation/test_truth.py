"""The written poses are true: what stands still is where it was, scan after scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from slam.data import se3
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.simulation.simulation import Simulation, SimulationConfig

FRAMES = (0, 25, 50)  # 20 m apart


@pytest.mark.parametrize("drive", ["lorries", "straight", "tunnel"])
@pytest.mark.parametrize("format", ["kitti", "folder"])
def test_walls_coincide_where_the_written_poses_put_them(drive: str, format: str, tmp_path: Path) -> None:
    simulation = Simulation(SimulationConfig(drive, camera=False, format=format))
    folder = tmp_path / "drive"
    simulation.write(folder, 0)
    for number in FRAMES:
        simulation.write_frame(folder, number)
    data = open_dataset(folder)
    truth = data.ground_truth
    assert truth is not None
    driven = simulation.rig.poses[list(FRAMES)]
    np.testing.assert_allclose(se3.inverse(truth[0]) @ truth, se3.inverse(driven[0]) @ driven, atol=1e-6)

    placed = [data[position].cloud.transformed(truth[position]).xyz.astype(float) for position in range(len(FRAMES))]
    for one, other in ((0, 1), (1, 2)):
        apart = _off_the_walls(placed[one], placed[other])
        assert len(apart) > 300
        assert abs(np.median(apart)) < 0.01  # lasers have constant errors of 2 cm, and the two scans see by others
        assert np.percentile(np.abs(apart), 75) < 0.05


def _off_the_walls(one: Array, other: Array) -> Array:
    """Signed distances [m] of points of the other scan, from half a metre below the LiDAR to 4.5 m above it, from
    planes through those of the one around them; only where these are plane and upright."""
    high = [cloud[(cloud[:, 2] > -0.5) & (cloud[:, 2] < 4.5)] for cloud in (one, other)]
    tree = cKDTree(high[0])
    distance, near = tree.query(high[1], k=12)
    found = distance[:, -1] < 0.6
    patches = high[0][near[found]]
    middle = patches.mean(axis=1)
    spread, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", patches - middle[:, None], patches - middle[:, None]) / 12)
    normal = axes[:, :, 0]
    flat = (spread[:, 0] < 0.03**2) & (spread[:, 1] > 0.05**2) & (np.abs(normal[:, 2]) < 0.2)
    outward = normal * np.sign(normal[:, 1])[:, None]
    return np.asarray(np.einsum("ni,ni->n", high[1][found] - middle, outward)[flat])
