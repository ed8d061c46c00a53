from __future__ import annotations

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.simulation.materials import INDEX
from slam.simulation.mesh import Mesh, box, joined, quads
from slam.simulation.world import StandingWorld, World

EYE = np.array([0.0, 0.0, 1.0])
AHEAD, UP = [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]


def wall(x: float, material: str, colour: tuple[int, int, int]) -> Mesh:
    """Across the x axis."""
    return quads(np.array([(x, -2, -2), (x, 2, -2), (x, 2, 4), (x, -2, 4)]), material, colour)


NEAR, FAR = wall(5, "brick", (1, 2, 3)), wall(9, "plaster", (4, 5, 6))


def test_a_ray_ends_at_the_first_triangle_and_tells_which() -> None:
    world = World(StandingWorld(joined([FAR, NEAR])))
    hits = world.cast(EYE, np.array([AHEAD, UP]))
    np.testing.assert_allclose(hits.reach, [5, np.inf], rtol=1e-5)
    assert hits.triangle[0] in (2, 3)
    assert hits.triangle[1] == -1
    np.testing.assert_allclose(np.abs(hits.normal[0]), [1, 0, 0], atol=1e-6)
    assert world.material[hits.triangle[0]] == INDEX["brick"]
    assert tuple(world.colour[hits.triangle[0]]) == (1, 2, 3)


def test_reach_is_in_units_of_the_direction() -> None:
    world = World(StandingWorld(NEAR))
    hits = world.cast(EYE, np.array([(1, 0, 0), (0.5, 0, 0), (4, 0, 0), (1, 0.2, 0)]))
    np.testing.assert_allclose(hits.reach, [5, 10, 1.25, 5], rtol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(hits.normal, axis=1), 1, rtol=1e-5)


def test_every_ray_may_have_an_origin_of_its_own() -> None:
    world = World(StandingWorld(NEAR))
    hits = world.cast(np.array([(0, 0, 1), (2, 0, 1), (7.0, 0, 1)]), np.array([AHEAD] * 3))
    np.testing.assert_allclose(hits.reach, [5, 3, np.inf], rtol=1e-5)


@pytest.mark.parametrize(("standing", "moving"), [(FAR, NEAR), (NEAR, FAR)], ids=["moving first", "standing first"])
def test_the_nearer_of_standing_and_moving_is_hit(standing: Mesh, moving: Mesh) -> None:
    world = World(StandingWorld(standing), [moving])
    hits = world.cast(EYE, np.array([AHEAD, UP]))
    np.testing.assert_allclose(hits.reach, [5, np.inf], rtol=1e-5)
    assert world.material[hits.triangle[0]] == INDEX["brick"]
    assert tuple(world.colour[hits.triangle[0]]) == (1, 2, 3)
    assert hits.triangle[1] == -1


def test_what_moves_is_seen_where_nothing_stands() -> None:
    world = World(StandingWorld(NEAR), [box((1, 1, 1), "car_paint", (7, 8, 9)).placed(0, 0, 20)])
    hits = world.cast(EYE, np.array([UP]))
    np.testing.assert_allclose(hits.reach, [19], rtol=1e-5)
    np.testing.assert_allclose(np.abs(hits.normal), [UP], atol=1e-6)
    assert tuple(world.colour[hits.triangle[0]]) == (7, 8, 9)


def test_one_standing_world_serves_many_moments() -> None:
    standing = StandingWorld(FAR)
    reach = [World(standing, [NEAR.placed(x, 0, 0)]).cast(EYE, np.array([AHEAD])).reach[0] for x in (-2, 0, 6)]
    np.testing.assert_allclose(reach, [3, 5, 9], rtol=1e-5)


def test_hidden_behind_what_stands_or_moves_at_any_distance() -> None:
    world = World(StandingWorld(FAR), [box((1, 1, 1), "car_paint").placed(0, 0, 500)])
    ways = np.array([AHEAD, UP, [-1.0, 0, 0], [0, 1.0, 0]])
    np.testing.assert_array_equal(world.hidden(EYE, ways), [True, True, False, False])
    np.testing.assert_array_equal(World(StandingWorld(FAR)).hidden(EYE, ways), [True, False, False, False])


@pytest.mark.parametrize("moves", [False, True], ids=["standing", "moving"])
def test_far_from_the_origin_planes_are_hit_to_a_tenth_of_a_millimetre(moves: bool) -> None:
    """Float32 alone has steps of half a millimetre there."""
    place = np.array([5000.123, -4999.777, 120.011])
    slope = np.array([(-60, -60, -6), (60, -60, 6), (60, 60, 6), (-60, 60, -6)])  # z = x / 10
    plane, other = quads(slope + place, "asphalt"), box((1, 1, 1), "brick").placed(*place + np.array([0, 50, 40]))
    world = World(StandingWorld(other), [plane]) if moves else World(StandingWorld(joined([plane, other])))
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    ways = np.column_stack([np.cos(angle), np.sin(angle), np.full(90, -0.15)])
    eye = place + np.array([1.111, 2.222, 1.333])
    hits = world.cast(eye, ways)
    expected: Array = (1.333 - 0.1111) / (0.15 + 0.1 * ways[:, 0])
    assert expected.max() > 20
    np.testing.assert_allclose(hits.reach, expected, rtol=0, atol=1e-4)
