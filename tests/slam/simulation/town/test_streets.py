import numpy as np
import pytest

from slam.simulation.drives import built_in
from slam.simulation.mesh import joined
from slam.simulation.terrain import Terrain
from slam.simulation.town.streets import HALF_WIDTH, PAVEMENT, Streets
from slam.simulation.world import StandingWorld, World

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def loop() -> tuple[Streets, Terrain, World]:
    drive = built_in("loop")
    streets = Streets(drive, np.random.default_rng(3))
    terrain = Terrain(drive.position, np.random.default_rng(3))
    return streets, terrain, World(StandingWorld(joined(streets.surface(terrain))))


def heights(streets: Streets, terrain: Terrain, world: World, left: float, metres: np.ndarray) -> np.ndarray:
    """Height of the street above the terrain, `left` of the middle of the first road."""
    road = streets.roads[0]
    above = terrain.lifted(road.line[metres] + left * road.left[metres])
    hits = world.cast(above + np.array([0, 0, 5.0]), np.tile(DOWN, (len(metres), 1)))
    return 5.0 - hits.reach


def test_the_whole_way_is_road(loop: tuple[Streets, Terrain, World]) -> None:
    streets, terrain, world = loop
    above = terrain.lifted(streets.path[1:-1]) + np.array([0, 0, 5.0])
    for aside in (-0.8, 0.0, 0.8):
        reach = world.cast(above + np.array([aside, aside, 0]), np.tile(DOWN, (len(above), 1))).reach
        np.testing.assert_allclose(reach, 5.0, atol=0.08)


def test_across_a_street_the_kerbs_rise(loop: tuple[Streets, Terrain, World]) -> None:
    streets, terrain, world = loop
    metres = np.arange(5, 45)  # before the first side street
    for side in (-1, 1):
        gutter = heights(streets, terrain, world, side * (HALF_WIDTH - 0.05), metres)
        pavement = heights(streets, terrain, world, side * (HALF_WIDTH + 1), metres)
        assert np.median(pavement - gutter) == pytest.approx(0.12, abs=0.02)
        beyond = heights(streets, terrain, world, side * (HALF_WIDTH + PAVEMENT + 0.1), metres)
        assert np.isneginf(beyond).mean() > 0.8


def test_a_street_driven_twice_is_built_once(loop: tuple[Streets, Terrain, World]) -> None:
    streets, _, _ = loop
    built = sum(len(road.line) for road in streets.roads[:2])
    assert built < len(streets.path) - 60


def test_middle_lines_are_half_a_lane_to_the_left(loop: tuple[Streets, Terrain, World]) -> None:
    streets, _, _ = loop
    assert np.median(streets.distance(streets.path)) == pytest.approx(1.75, abs=0.05)
