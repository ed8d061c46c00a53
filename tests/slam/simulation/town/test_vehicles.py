from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.simulation.materials import INDEX
from slam.simulation.mesh import Mesh
from slam.simulation.town.vehicles import SHAPES, bicycle, car, car_of, person
from slam.simulation.world import Hits, StandingWorld, World

SEEDS = range(6)


def corners(mesh: Mesh, *materials: str) -> Array:
    chosen = np.isin(mesh.material, [INDEX[name] for name in materials])
    return mesh.vertices[mesh.triangles[chosen]].reshape(-1, 3)


def areas(mesh: Mesh) -> Array:
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def cast(mesh: Mesh, origin: list[list[float]], direction: list[float]) -> Hits:
    return World(StandingWorld(mesh)).cast(np.array(origin), np.tile(direction, (len(origin), 1)))


@pytest.mark.parametrize("make", [car, bicycle, person])
def test_the_same_seed_makes_the_same_and_seeds_differ(make: Callable[[np.random.Generator], Mesh]) -> None:
    first, again = make(np.random.default_rng(1)), make(np.random.default_rng(1))
    for name in ("vertices", "triangles", "material", "colour"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert len({make(np.random.default_rng(seed)).colour.tobytes() for seed in range(20)}) > 3


@pytest.mark.parametrize("kind", SHAPES)
def test_a_car_has_the_size_of_its_kind_and_stands_on_its_wheels(kind: str) -> None:
    for seed in SEEDS:
        mesh = car_of(SHAPES[kind], np.random.default_rng(seed))
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        np.testing.assert_allclose(low[:2], -high[:2], atol=0.05)
        assert 3.6 < high[0] - low[0] < 5.3
        assert 1.4 <= high[2] <= 2.1
        assert abs(low[2]) < 0.01
        assert 0.15 <= corners(mesh, "car_paint", "glass", "plate")[:, 2].min() <= 0.2
        wheels = corners(mesh, "tyre")
        down = wheels[np.abs(wheels[:, 2]) < 0.01]
        assert {(float(sx), float(sy)) for sx, sy in np.sign(down[:, :2])} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_car_is_as_wide_as_cars_are(kind: str) -> None:
    for seed in SEEDS:
        mesh = car_of(SHAPES[kind], np.random.default_rng(seed))
        below_mirrors = mesh.vertices[mesh.vertices[:, 2] < 0.8]
        assert 1.65 <= np.ptp(below_mirrors[:, 1]) <= 2.02


@pytest.mark.parametrize("kind", SHAPES)
def test_budget_and_no_triangle_that_is_a_line(kind: str) -> None:
    for seed in SEEDS:
        mesh = car_of(SHAPES[kind], np.random.default_rng(seed))
        assert 150 <= len(mesh) <= 500
        assert areas(mesh).min() > 1e-5


@pytest.mark.parametrize("kind", SHAPES)
def test_rays_see_what_a_car_has(kind: str) -> None:
    mesh = car_of(SHAPES[kind], np.random.default_rng(2))
    end, side = SHAPES[kind].length[0] / 2, mesh.vertices[:, 1].max()
    windscreen = [[9.0, 0.3, SHAPES[kind].belt + 0.2]]
    assert mesh.material[cast(mesh, windscreen, [-1, 0, 0]).triangle] == INDEX["glass"]
    door = cast(mesh, [[0.0, 5.0, 0.5]], [0, -1, 0])
    assert mesh.material[door.triangle] == INDEX["car_paint"]
    assert door.reach[0] > 5 - side
    under = cast(mesh, [[0.0, 5.0, 0.1]], [0, -1, 0])
    assert np.isinf(under.reach[0])
    roof, bonnet = cast(mesh, [[-0.2, 0.0, 5.0], [end - 0.4, 0.0, 5.0]], [0, 0, -1]).reach
    assert bonnet > roof + 0.4


def test_plates_look_ahead_and_back() -> None:
    mesh = car(np.random.default_rng(0))
    hits = cast(mesh, [[9.0, 0.0, 0.47]], [-1, 0, 0]), cast(mesh, [[-9.0, 0.0, 0.47]], [1, 0, 0])
    assert [mesh.material[hit.triangle[0]] for hit in hits] == [INDEX["plate"]] * 2


def test_cars_are_mostly_grey_black_and_white_and_of_every_kind() -> None:
    cars = [car(np.random.default_rng(seed)) for seed in range(150)]
    paint = np.array([mesh.colour[mesh.material == INDEX["car_paint"]][0] for mesh in cars], float)
    assert 0.65 < (np.ptp(paint, axis=1) < 12).mean() < 0.9
    heights = np.array([mesh.vertices[:, 2].max() for mesh in cars])
    assert (heights < 1.55).sum() > 75
    assert (heights > 1.85).sum() > 3


def test_people_and_bicycles_are_of_their_size() -> None:
    for seed in SEEDS:
        human, bike = person(np.random.default_rng(seed)), bicycle(np.random.default_rng(seed))
        assert 1.5 < human.vertices[:, 2].max() < 2.0
        assert np.ptp(human.vertices[:, 1]) < 0.8
        np.testing.assert_allclose(np.ptp(bike.vertices, axis=0), [1.74, 0.56, 1.05], atol=0.03)
        for mesh in (human, bike):
            assert abs(mesh.vertices[:, 2].min()) < 0.01
            assert len(mesh) < 250
            assert areas(mesh).min() > 1e-5
