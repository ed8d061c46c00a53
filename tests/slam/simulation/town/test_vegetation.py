from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.simulation.materials import INDEX
from slam.simulation.mesh import Mesh
from slam.simulation.town.vegetation import bush, conifer, deciduous, hedge, poplar, tree
from slam.simulation.world import StandingWorld, World

Plant = Callable[[np.random.Generator], Mesh]
PLANTS: tuple[Plant, ...] = (deciduous, conifer, poplar, bush, lambda rng: hedge(rng, 4.3))
SEEDS = range(8)


def grown(plant: Plant, seed: int) -> Mesh:
    return plant(np.random.default_rng(seed))


def areas(mesh: Mesh) -> Array:
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def passing(mesh: Mesh, x: Array, z: Array) -> float:
    """Share of the rays along y, at x and z, that meet nothing."""
    origin = np.column_stack([x, np.full(x.size, -20.0), z])
    hits = World(StandingWorld(mesh)).cast(origin, np.tile([0.0, 1.0, 0.0], (x.size, 1)))
    return float((hits.triangle < 0).mean())


@pytest.mark.parametrize("plant", PLANTS)
def test_the_same_seed_grows_the_same_plant_and_another_seed_another(plant: Plant) -> None:
    first, again, other = grown(plant, 3), grown(plant, 3), grown(plant, 4)
    for name in ("vertices", "triangles", "material", "colour"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert abs(first.vertices[:, 2].max() - other.vertices[:, 2].max()) > 0.01


@pytest.mark.parametrize("plant", PLANTS)
def test_no_triangle_is_a_line(plant: Plant) -> None:
    assert min(areas(grown(plant, seed)).min() for seed in SEEDS) > 1e-5


@pytest.mark.parametrize("plant", PLANTS)
def test_roots_reach_below_the_ground_at_the_origin(plant: Plant) -> None:
    for seed in SEEDS:
        z = grown(plant, seed).vertices[:, 2]
        assert -0.35 < z.min() < -0.25


def test_trees_are_of_a_trees_size_and_come_in_several_forms() -> None:
    slenderness = []
    for seed in range(40):
        mesh = grown(tree, seed)
        size = np.ptp(mesh.vertices, axis=0)
        assert 4.0 < mesh.vertices[:, 2].max() < 14.0
        assert size[:2].min() > 1.0
        assert size[:2].max() < 8.0
        assert 250 <= len(mesh) <= 700
        assert set(np.unique(mesh.material)) == {INDEX["bark"], INDEX["leaves"]}
        slenderness.append(size[2] / size[:2].max())
    assert min(slenderness) < 2 < 3.5 < max(slenderness)


def test_bushes_are_low() -> None:
    for seed in SEEDS:
        mesh = grown(bush, seed)
        assert 0.7 < mesh.vertices[:, 2].max() < 2.3
        assert 100 <= len(mesh) <= 200


@pytest.mark.parametrize("plant", [deciduous, conifer, poplar])
def test_a_crown_lets_some_rays_pass_and_spreads_the_rest_over_its_depth(plant: Plant) -> None:
    for seed in SEEDS:
        mesh = grown(plant, seed)
        leaves = mesh.vertices[mesh.triangles[mesh.material == INDEX["leaves"]]].mean(axis=1)
        (left, low), (right, high) = np.percentile(leaves[:, [0, 2]], [10, 90], axis=0)
        x, z = (a.ravel() for a in np.meshgrid(np.linspace(left, right, 50), np.linspace(low, high, 50)))
        assert 0.15 < passing(mesh, x, z) < 0.85
        origin = np.column_stack([x, np.full(x.size, -20.0), z])
        reach = World(StandingWorld(mesh)).cast(origin, np.tile([0.0, 1.0, 0.0], (x.size, 1))).reach
        nearest, deep = np.percentile(reach[np.isfinite(reach)], [5, 95])
        assert deep - nearest > 0.4 * np.ptp(leaves[:, 1])


def test_leaves_are_denser_towards_the_outside_of_a_crown() -> None:
    for seed in SEEDS:
        mesh = grown(deciduous, seed)
        leaves = mesh.vertices[mesh.triangles[mesh.material == INDEX["leaves"]]].mean(axis=1)
        low, high = leaves.min(axis=0), leaves.max(axis=0)
        depth = np.linalg.norm((leaves - (low + high) / 2) / ((high - low) / 2), axis=1)
        inside = (depth < 0.5).mean() / 0.5**3
        outside = ((depth > 0.5) & (depth < 0.9)).mean() / (0.9**3 - 0.5**3)
        assert outside > inside


@pytest.mark.parametrize("length", [1.0, 4.3, 17.0])
def test_a_hedge_keeps_its_length_and_lets_hardly_a_ray_through(length: float) -> None:
    for seed in SEEDS:
        mesh = hedge(np.random.default_rng(seed), length)
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        assert -0.3 < low[0] < 0.1
        assert length - 0.1 < high[0] < length + 0.3
        assert 0.5 < high[1] - low[1] < 1.4
        assert 0.8 < high[2] < 2.3
        assert len(mesh) <= 60 * length
        x, z = np.meshgrid(np.linspace(0, length, 80), np.linspace(0.05, 0.85 * high[2], 30))
        assert passing(mesh, x.ravel(), z.ravel()) < 0.1
