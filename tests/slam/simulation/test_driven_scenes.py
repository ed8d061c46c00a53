"""Properties of the scenes of all built-in drives of cars."""

from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.simulation.course import Road
from slam.simulation.drive_names import DRIVES
from slam.simulation.driven_scene import DrivenScene
from slam.simulation.drives import Drive, built_in, from_file
from slam.simulation.mesh import joined
from slam.simulation.scene import SCENES
from slam.simulation.world import StandingWorld, World

UP = np.array([0.0, 0.0, 1.0])
CARS = [name for name in DRIVES.names() if built_in(name).scene != "building"]


@pytest.fixture(scope="module", params=CARS)
def scene(request: pytest.FixtureRequest) -> DrivenScene:
    return scene_of(built_in(request.param), 5)


def scene_of(drive: Drive, seed: int) -> DrivenScene:
    found = SCENES.load(drive.scene)(drive, seed, np.random.default_rng([seed, 0]))
    assert isinstance(found, DrivenScene)
    return found


def swept(drive: Drive, scene: DrivenScene) -> tuple[Array, Array]:
    """Rays along the path at a car's width and heights, each as long as the distance to the next point."""
    line = drive.position[:: max(len(drive) // 150, 1), :2]
    line = line[np.concatenate([[True], np.linalg.norm(np.diff(line, axis=0), axis=1) > 0.05])]
    left = Road(line).left
    starts, ways = [], []
    for aside in (-0.95, 0.0, 0.95):
        for above in (0.3, 1.0, 1.9):
            points = scene.terrain.lifted(line + aside * left) + above * UP
            starts.append(points[:-1])
            ways.append(np.diff(points, axis=0))
    return np.concatenate(starts), np.concatenate(ways)


def test_nothing_stands_in_the_way(scene: DrivenScene) -> None:
    drive = scene.drive
    whole = scene.around(drive.position[len(drive) // 2, :2], 1e4)
    assert len(whole) == len(scene.standing)
    hits = World(StandingWorld(whole)).cast(*swept(drive, scene))
    assert (hits.reach > 1.0).all()


def test_there_is_ground_under_the_car(scene: DrivenScene) -> None:
    poses = scene.poses(1.73)[::20]
    world = World(StandingWorld(scene.around(scene.drive.position[0, :2], 1e4)))
    down = world.cast(poses[:, :3, 3], np.tile(-UP, (len(poses), 1))).reach
    np.testing.assert_allclose(down, 1.73, atol=0.06)


def test_what_stands_around_a_place_is_small_enough_to_be_quick(scene: DrivenScene) -> None:
    drive = scene.drive
    for frame in (0, len(drive) // 2, len(drive) - 1):
        assert 5_000 < len(scene.around(drive.position[frame, :2], 150)) < 1_000_000


def test_traffic_keeps_its_distance(scene: DrivenScene) -> None:
    drive = scene.drive
    if drive.scene == "bridge":
        assert len(scene.traffic) == 0
        return
    assert len(scene.traffic) > 0
    seen = 0
    for frame in range(0, len(drive), 12):
        moving = joined(scene.moving(frame))
        seen += len(moving) > 0
        if len(moving):
            apart = np.linalg.norm(moving.vertices[:, :2] - drive.position[frame, :2], axis=1)
            assert apart.min() > 1.2, "outside the car's own body"
            above = moving.vertices[:, 2] - scene.terrain.height(*moving.vertices[:, :2].T)
            assert above.min() > -0.4
            assert above.max() < 4.5
    assert seen > 3


@pytest.mark.parametrize("name", ["jam", "motorway", "lorries", "traffic"])
def test_the_same_seed_grows_the_same_scene_and_another_does_not(name: str) -> None:
    first, again, other = (scene_of(built_in(name), seed) for seed in (3, 3, 4))
    meshes = [joined([scene.around(np.zeros(2), 100), *scene.moving(5)]) for scene in (first, again, other)]
    for field in ("vertices", "triangles", "material", "colour"):
        assert getattr(meshes[0], field).tobytes() == getattr(meshes[1], field).tobytes()
    assert meshes[0].vertices.tobytes() != meshes[2].vertices.tobytes()


def test_a_real_way_gets_its_town(archives: Path) -> None:
    drive = from_file(archives / "trajectories" / "kitti_07_ground_truth.txt", spacing=1.5)
    scene = scene_of(drive, 0)
    hits = World(StandingWorld(scene.around(np.zeros(2), 1e4))).cast(*swept(drive, scene))
    assert (hits.reach > 1.0).all(), "nothing stands in the way"
