from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.simulation.course import Road
from slam.simulation.drives import DRIVES, Drive, built_in, from_file
from slam.simulation.mesh import joined
from slam.simulation.town.scene import TownScene
from slam.simulation.town.town import Town
from slam.simulation.town.traffic import TownTraffic
from slam.simulation.world import StandingWorld, World

STRAIGHT_UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module", params=[name for name in DRIVES if built_in(name).scene == "town"])
def grown(request: pytest.FixtureRequest) -> tuple[Drive, Town]:
    drive = built_in(request.param)
    return drive, town_of(drive, 5)


def town_of(drive: Drive, seed: int) -> Town:
    return TownScene(drive, seed, np.random.default_rng([seed, 0])).standing


def swept(drive: Drive, town: Town) -> tuple[Array, Array]:
    """Rays along the way at a car's width and heights, each as long as to the next point."""
    line = drive.position[:: max(len(drive) // 150, 1), :2]
    line = line[np.concatenate([[True], np.linalg.norm(np.diff(line, axis=0), axis=1) > 0.05])]
    left = Road(line).left
    starts, ways = [], []
    for aside in (-0.95, 0.0, 0.95):
        for above in (0.3, 1.0, 1.9):
            points = town.terrain.lifted(line + aside * left) + above * STRAIGHT_UP
            starts.append(points[:-1])
            ways.append(np.diff(points, axis=0))
    return np.concatenate(starts), np.concatenate(ways)


def test_nothing_stands_in_the_way(grown: tuple[Drive, Town]) -> None:
    drive, town = grown
    whole = town.around(drive.position[len(drive) // 2, :2], 1e4)
    assert len(whole) == len(town)
    hits = World(StandingWorld(whole)).cast(*swept(drive, town))
    assert (hits.reach > 1.0).all()


def test_a_stretch_of_town_is_small_enough_to_be_quick(grown: tuple[Drive, Town]) -> None:
    drive, town = grown
    for frame in (0, len(drive) // 2, len(drive) - 1):
        assert 5_000 < len(town.around(drive.position[frame, :2], 150)) < 1_000_000


def test_the_same_seed_grows_the_same_town_and_another_does_not() -> None:
    drive = built_in("jam")
    first, again, other = (town_of(drive, seed).around(np.zeros(2), 1e4) for seed in (3, 3, 4))
    for field in ("vertices", "triangles", "material", "colour"):
        assert getattr(first, field).tobytes() == getattr(again, field).tobytes()
    assert first.vertices.shape != other.vertices.shape


def test_a_real_way_gets_its_town(archives: Path) -> None:
    drive = from_file(archives / "trajectories" / "kitti_07_ground_truth.txt", spacing=1.5)
    town = town_of(drive, 0)
    hits = World(StandingWorld(town.around(np.zeros(2), 1e4))).cast(*swept(drive, town))
    assert (hits.reach > 1.0).all()


def test_in_the_tunnel_every_direction_but_the_way_ends_at_its_wall() -> None:
    drive = built_in("tunnel")
    town = town_of(drive, 0)
    frame = int(np.argmin(np.abs(drive.way - 160)))
    angle = np.linspace(0.3, np.pi - 0.3, 40)
    beams = np.column_stack([0.2 * np.ones(40), np.cos(angle), np.sin(angle)])
    eye = town.terrain.lifted(drive.position[frame, :2]) + 1.7 * STRAIGHT_UP
    world = World(StandingWorld(town.around(eye[:2], 150)))
    hits = [world.cast(eye + np.array([way, 0, 0]), beams).reach for way in (0.0, 5.5)]
    assert hits[0].max() < 15
    np.testing.assert_allclose(hits[0], hits[1], atol=0.02)  # it looks the same farther on


def test_traffic_keeps_its_distance(grown: tuple[Drive, Town]) -> None:
    drive, town = grown
    traffic = TownTraffic.of(drive, town, np.random.default_rng(1))
    assert len(traffic) > 0
    seen = 0
    for frame in range(0, len(drive), 12):
        moving = joined(traffic.at(frame))
        seen += len(moving) > 0
        if len(moving):
            apart = np.linalg.norm(moving.vertices[:, :2] - drive.position[frame, :2], axis=1)
            assert apart.min() > 1.2, "outside the car's own body"
            above = moving.vertices[:, 2] - town.terrain.height(*moving.vertices[:, :2].T)
            assert above.min() > -0.4
            assert above.max() < 4.5
    assert seen > 3
