import numpy as np

from slam.simulation.drives import built_in
from slam.simulation.town.scene import TownScene
from slam.simulation.world import StandingWorld, World

STRAIGHT_UP = np.array([0.0, 0.0, 1.0])


def test_in_the_tunnel_every_direction_but_the_way_ends_at_its_wall() -> None:
    drive = built_in("tunnel")
    town = TownScene(drive, 0, np.random.default_rng([0, 0])).standing
    frame = int(np.argmin(np.abs(drive.way - 160)))
    angle = np.linspace(0.3, np.pi - 0.3, 40)
    beams = np.column_stack([0.2 * np.ones(40), np.cos(angle), np.sin(angle)])
    eye = town.terrain.lifted(drive.position[frame, :2]) + 1.7 * STRAIGHT_UP
    world = World(StandingWorld(town.around(eye[:2], 150)))
    hits = [world.cast(eye + np.array([way, 0, 0]), beams).reach for way in (0.0, 5.5)]
    assert hits[0].max() < 15
    np.testing.assert_allclose(hits[0], hits[1], atol=0.02)  # it looks the same farther on
