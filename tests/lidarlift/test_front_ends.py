"""Front ends of runs: each run has its own, whatever it learns from the scans."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from enrichment.enricher import Enricher
from lidarlift.comparing import available_inputs, comparison_title, rows_for
from lidarlift.front_ends import front_end_for, front_end_maker, front_end_notes, settings_for
from slam.config import load_config
from slam.data.cloud import Array
from slam.data.dataset import open_dataset, ring_count
from slam.data.errors import InputError
from slam.data.folder import UserFolder
from slam.data.sensor import load_sensor
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


def ring_drive(folder: Path, rings: int) -> UserFolder:
    """Two scans with a ring field, counted from the bottom, of an unknown LiDAR."""
    ring = np.tile(np.arange(rings), 60)
    azimuth, elevation = np.repeat(np.arange(60) * np.pi / 30, rings), np.linspace(-0.4, 0.3, rings)[ring]
    points = np.zeros(len(ring), [("x", "f4"), ("y", "f4"), ("z", "f4"), ("ring", "u2")])
    points["x"], points["y"], points["z"] = 9 * np.cos(azimuth), 9 * np.sin(azimuth), 9 * np.tan(elevation)
    points["ring"] = ring
    for number in range(2):
        np.save(folder / f"{number}.npy", points)
    return UserFolder(folder)


@pytest.mark.parametrize(("rings", "left"), [(16, 16), (32, 16), (40, 16), (64, 16), (128, 16)])
def test_sixteen_rings_of_a_lidar_that_nobody_names(tmp_path: Path, rings: int, left: int) -> None:
    data = ring_drive(tmp_path, rings)
    assert ring_count(data) == rings
    settings = settings_for(ring_count(data), "16").front_end
    cloud = front_end_for(settings, data.sensor, data.path, ring_count(data))(data[0], [])
    assert cloud.ring is not None
    assert len(np.unique(cloud.ring)) == left
    assert cloud.xyz[cloud.ring == 0, 2].min() > 2  # the uppermost is ring 0, and stays


@pytest.mark.parametrize(
    ("rings", "default"), [(None, "full"), (8, "full"), (16, "16"), (32, "full"), (64, "64"), (128, "full")]
)
def test_all_rings_are_taken_where_nothing_is_asked_for(rings: int | None, default: str) -> None:
    assert settings_for(rings).front_end.input == default
    assert settings_for(rings, "full").front_end.input == "full"


@pytest.mark.parametrize("rings", [16, 32, 128])
def test_64_is_of_64_rings(rings: int) -> None:
    with pytest.raises(InputError, match=f"has {rings} rings; use --input full"):
        settings_for(rings, "64")


@pytest.mark.parametrize(
    ("name", "inputs"),
    [
        ("vlp16", ["16", "enriched"]),
        ("hdl32", ["16", "enriched", "full"]),
        ("hdl64", ["16", "enriched", "64"]),
        ("os0-128", ["16", "enriched", "full"]),
    ],
)
def test_available_inputs_depend_on_the_sensor(tmp_path: Path, name: str, inputs: list[str]) -> None:
    np.save(tmp_path / "0.npy", np.ones((50, 4), np.float32))
    assert available_inputs(UserFolder(tmp_path, name)) == inputs


def test_a_lidar_without_rings_has_only_the_full_scan(tmp_path: Path) -> None:
    np.save(tmp_path / "0.npy", np.ones((50, 4), np.float32))
    data = UserFolder(tmp_path)
    assert available_inputs(data) == ["full"]
    title = comparison_title(data, rows_for(["full"]), slice(None))
    assert "1 frames, not enriched: the scans have no rings, and the laser lines are unknown; name the LiDAR" in title


def test_a_lidar_whose_lines_are_unknown_is_not_enriched(tmp_path: Path) -> None:
    data = ring_drive(tmp_path, 16)
    assert available_inputs(data) == ["16"]
    settings = load_config(input="enriched").front_end
    with pytest.raises(InputError, match=r"no enrichment: the laser lines are unknown; name the LiDAR"):
        front_end_for(settings, data.sensor, data.path, ring_count(data))


@pytest.mark.parametrize(("rings", "name"), [(32, "48"), (16, "32"), (40, "64")])
def test_more_rings_than_there_are(rings: int, name: str) -> None:
    with pytest.raises(InputError, match=f"--input {name}: the LiDAR has {rings} rings; use --input full"):
        settings_for(rings, name)


def test_a_configuration_states_the_input() -> None:
    assert settings_for(32, config="paper").front_end.input == "16"
    assert settings_for(32, overrides=["front_end.input=8"]).front_end.input == "8"
    assert settings_for(32, "full", overrides=["front_end.input=8"]).front_end.input == "full"


def test_lift_leaves_gaps_unlike_those_of_its_training_to_ray_segment() -> None:
    settings = load_config(input="enriched", enricher="lift").front_end
    assert front_end_notes(settings, load_sensor("vlp16")) == ()
    assert front_end_notes(settings, load_sensor("hdl64")) == ()
    (note,) = front_end_notes(settings, load_sensor("vlp32c"))
    assert note.startswith("lift: 20 of the 31 gaps between rings are not between 0.6 and 4.3 deg wide")
    assert front_end_notes(load_config(input="enriched").front_end, load_sensor("vlp32c")) == ()


def test_some_rings_of_a_dense_lidar_are_enriched() -> None:
    settings = load_config(input="enriched", overrides=["front_end.enriched_rings=16"]).front_end
    enricher = front_end_for(settings, load_sensor("os1-128"), "sequence")
    assert isinstance(enricher, Enricher)
    assert enricher.rings.tolist() == list(range(0, 128, 8))
    assert enricher.target.ring_count == 128


@pytest.mark.parametrize("method", ["ray-segment", "lift"])
def test_a_lidar_too_dense_to_enrich_is_refused_with_the_reason(method: str) -> None:
    settings = load_config(input="enriched", enricher=method).front_end
    with pytest.raises(InputError, match=r"os1-128 has 128 rings, too dense for virtual beams .* --input full"):
        front_end_for(settings, load_sensor("os1-128"), "drive")
