"""Front ends of runs: each run has its own, whatever it learns from the scans."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lidarlift.front_ends import front_end_maker
from slam.config import load_config
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.pipeline import Pipeline

#: Ranges that are a millimetre longer each time it is asked.
TIRING = """
from dataclasses import replace
from enrichment.interpolation.ray_segment import RaySegment

class Tiring(RaySegment):
    asked = 0

    def __call__(self, scan, grid):
        self.asked += 1
        found = super().__call__(scan, grid)
        return replace(found, ranges=found.ranges + 0.001 * self.asked * (found.ranges > 0))
"""


@pytest.fixture
def tiring(installed: Callable[..., Path]) -> None:
    installed("its-tiring", "[lidarlift.methods]\ntiring = its_tiring:Tiring\n", {"its_tiring.py": TIRING})


def noisy(scan: Array, sigma: float) -> Array:
    """Points (N, 4) with normal errors of their ranges [m]."""
    xyz = scan[:, :3]
    error = np.random.default_rng(0).normal(0, sigma, (len(scan), 1))
    return np.column_stack([xyz * (1 + error / np.linalg.norm(xyz, axis=1, keepdims=True)), scan[:, 3]])


@pytest.mark.parametrize("method", ["ray-segment", "tiring"])
@pytest.mark.usefixtures("tiring")
def test_a_pipeline_gives_the_same_bytes_each_time(
    street_drive: Callable[..., Path], street_scans: list[Array], method: str
) -> None:
    """On ranges so noisy, and ever noisier, that the calibration of sigma has something to say."""
    scans = {number: noisy(scan, 0.1 + 0.05 * number) for number, scan in enumerate(street_scans)}
    data, config = open_dataset(street_drive(scans)), load_config(input="enriched", enricher=method)
    pipeline = Pipeline(config, front_end_maker(config.front_end, data.sensor, data.path))
    one, two = pipeline.run(data), pipeline.run(data)
    assert one.records[0].points > 2 * 16 * 600
    assert one.poses.tobytes() == two.poses.tobytes()
    for name in ("xyz", "intensity"):
        assert getattr(one.map, name).tobytes() == getattr(two.map, name).tobytes()
