from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from slam.simulation.materials import INDEX, MATERIALS
from slam.simulation.mesh import Mesh
from slam.simulation.town.buildings import FOOT, building
from slam.simulation.town.roofs import EAVES
from slam.simulation.world import Hits, StandingWorld, World

SIZES = [(7.0, 8.0), (9.0, 11.0), (12.0, 10.0), (16.0, 12.0), (22.0, 14.0)]


def houses(seeds: range = range(12)) -> list[tuple[float, float, Mesh]]:
    return [(*size, building(np.random.default_rng(seed), *size)) for size in SIZES for seed in seeds]


def seen_from_street(mesh: Mesh, half: float, low: float, high: float) -> tuple[Hits, np.ndarray, np.ndarray]:
    """Return y and material of the hits of level rays towards +y."""
    world = World(StandingWorld(mesh))
    x, z = np.meshgrid(np.arange(-half, half, 0.05), np.arange(low, high, 0.05))
    origin = np.column_stack([x.ravel(), np.full(x.size, -10.0), z.ravel()])
    hits = world.cast(origin, np.tile([0.0, 1.0, 0.0], (x.size, 1)))
    return hits, hits.reach - 10.0, world.material[hits.triangle]


def test_the_same_generator_builds_the_same_house() -> None:
    one, other = (building(np.random.default_rng(5), 11, 10) for _ in range(2))
    for part in ("vertices", "triangles", "material", "colour"):
        np.testing.assert_array_equal(getattr(one, part), getattr(other, part))


def test_no_two_are_alike() -> None:
    row = [building(np.random.default_rng(seed), 11, 10) for seed in range(20)]
    for one, other in pairwise(row):
        assert len(one) != len(other) or not np.array_equal(one.colour, other.colour)
    assert len({round(house.vertices[:, 2].max() / 2.9) for house in row}) >= 4


def test_stays_on_its_ground() -> None:
    for width, depth, mesh in houses():
        x, y, z = mesh.vertices.T
        assert np.abs(x).max() <= width / 2 + EAVES + 1e-9
        assert y.min() >= -1.5
        assert depth <= y.max() <= depth + EAVES + 1e-9
        assert z.min() == pytest.approx(-FOOT)


def test_stays_within_its_budget() -> None:
    counts = [len(mesh) for _, _, mesh in houses()]
    assert max(counts) <= 1500
    assert np.median(counts) >= 300


def test_every_triangle_is_one() -> None:
    for _, _, mesh in houses(range(4)):
        a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-7
        assert mesh.material.max() < len(MATERIALS)


@pytest.mark.parametrize("seed", range(6))
def test_the_wall_stands_at_the_street_and_the_glass_behind_it(seed: int) -> None:
    mesh = building(np.random.default_rng(seed), 10, 9, storeys=1)
    _, y, material = seen_from_street(mesh, 4.9, 0.4, 2.9)
    glass = material == INDEX["glass"]
    assert glass.mean() > 0.05
    assert y[glass].min() > 0.1
    assert y[glass].max() < 0.25
    assert (np.abs(y) < 1e-3).mean() > 0.3


def test_no_ray_passes_through_a_facade() -> None:
    for seed in range(6):
        mesh = building(np.random.default_rng(seed), 12, 10, storeys=3)
        _, y, _ = seen_from_street(mesh, 5.99, -1.4, 8.9)
        assert y.max() < 0.25


def test_a_row_can_keep_its_height() -> None:
    def eaves(mesh: Mesh) -> float:
        """Position of the side walls' vertical edge, at the corner of the street."""
        x, y, z = mesh.vertices.T
        return float(z[(np.abs(x) > 4.999) & (np.abs(x) < 5.001) & (np.abs(y) < 1e-9)].max())

    heights = [eaves(building(np.random.default_rng(seed), 10, 10, storeys=3)) for seed in range(10)]
    assert np.ptp(heights) < 0.7
    assert 8.7 < min(heights) < max(heights) < 10
