"""The building: closed, with no obstacle on the path of the walk, and seen by the LiDAR at its true place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.simulation.drives import Drive, built_in
from slam.simulation.heads import Lidar
from slam.simulation.indoors.plan import CEILING, FOOT, HALF, HEAD, NORTH, RISE, RISERS, ROOMS, STOREY, TREAD, WEST
from slam.simulation.indoors.scene import BuildingScene
from slam.simulation.materials import MATERIALS
from slam.simulation.mesh import Mesh
from slam.simulation.rig import Rig
from slam.simulation.world import StandingWorld, World

UP = np.array([0.0, 0.0, 1.0])
AROUND = np.linspace(0, 2 * np.pi, 36, endpoint=False)
LEVEL = np.column_stack([np.cos(AROUND), np.sin(AROUND), np.zeros(36)])


class Built(NamedTuple):
    drive: Drive
    mesh: Mesh
    world: World


@pytest.fixture(scope="module", params=[0, 1, 2])
def built(request: pytest.FixtureRequest) -> Built:
    drive = built_in("building")
    mesh = scene(drive, request.param).mesh
    return Built(drive, mesh, World(StandingWorld(mesh)))


def scene(drive: Drive, seed: int) -> BuildingScene:
    return BuildingScene(drive, seed, np.random.default_rng([seed, 0]))


def nearest(world: World, at: Array, directions: Array) -> Array:
    """(N,) metres from each place (N, 3) to what is nearest in these directions (M, 3)."""
    origins = np.repeat(at, len(directions), axis=0)
    return world.cast(origins, np.tile(directions, (len(at), 1))).reach.reshape(len(at), -1).min(axis=1)


@pytest.mark.parametrize("above", [0.4, 0.8, 1.3, 1.75])
def test_nothing_stands_within_30_cm_of_the_walk(built: Built, above: float) -> None:
    assert nearest(built.world, built.drive.position + above * UP, LEVEL).min() > 0.3


def test_there_is_a_floor_underfoot_and_a_ceiling_overhead(built: Built) -> None:
    poses = scene(built.drive, 0).poses(1.3)
    hand = poses[:, :3, 3]
    below = nearest(built.world, hand, np.array([[0, 0, -1.0]]))
    above = nearest(built.world, hand, np.array([[0, 0, 1.0]]))
    assert 1.05 < below.min() < below.max() < 1.6
    assert 0.7 < above.min() < above.max() < 2 * STOREY


def test_no_ray_leaves_the_building(built: Built) -> None:
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(300, 3))
    hand = scene(built.drive, 0).poses(1.3)[::30, :3, 3]
    hits = built.world.cast(np.repeat(hand, 300, axis=0), np.tile(directions, (len(hand), 1)))
    assert np.isfinite(hits.reach).all()


def test_the_stairs_have_steps_of_equal_height(built: Built) -> None:
    y = FOOT + (np.arange(RISERS - 1) + 0.5) * TREAD
    eye = np.column_stack([np.full(RISERS - 1, WEST.up), y, np.full(RISERS - 1, 2.6)])
    height = 2.6 - built.world.cast(eye, np.tile([0, 0, -1.0], (RISERS - 1, 1))).reach
    np.testing.assert_allclose(height, RISE * np.arange(1, RISERS), atol=1e-4)
    upper = eye * [0, 1, 0] + [WEST.on, 0, 5.5]
    height = 5.5 - built.world.cast(upper, np.tile([0, 0, -1.0], (RISERS - 1, 1))).reach
    np.testing.assert_allclose(height[::-1], STOREY / 2 + RISE * np.arange(1, RISERS), atol=1e-4)
    assert NORTH[1] - 1.0 > HEAD, "room for a landing"


def test_the_corridors_are_40_m_long_and_straight(built: Built) -> None:
    for floor in (0.0, STOREY):
        eye = np.tile([20.0, 1.15, floor + 2.7], (2, 1))
        reach = built.world.cast(eye, np.array([[1.0, 0, 0], [-1.0, 0, 0]])).reach
        assert reach.sum() == pytest.approx(40, abs=0.5)


def test_rooms_are_furnished_within_their_walls(built: Built) -> None:
    inside = built.mesh.vertices
    assert (inside.min(axis=0) > [-0.5, -6.5, -0.01]).all()
    assert (inside.max(axis=0) < [40.7, 8.3, STOREY + CEILING + 0.01]).all()
    for room in ROOMS:
        if room.kind == "stairs":
            continue
        middle = inside[built.mesh.triangles].mean(axis=1)
        low = [room.x[0] + HALF + 0.05, room.y[0] + HALF + 0.05, room.floor * STOREY + 0.1]
        high = [room.x[1] - HALF - 0.05, room.y[1] - HALF - 0.05, room.floor * STOREY + CEILING - 0.1]
        assert ((middle > low) & (middle < high)).all(axis=1).sum() > 100, room


def test_its_surfaces_are_of_many_materials(built: Built) -> None:
    used = {MATERIALS[index].name for index in np.unique(built.mesh.material)}
    assert {"pane", "laminate", "fabric", "wood", "metal", "leaves", "concrete", "brick", "wallpaper", "lamp"} <= used


def test_the_same_seed_builds_the_same_and_another_furnishes_otherwise() -> None:
    drive = built_in("building")
    first, again, other = (scene(drive, seed).mesh for seed in (3, 3, 4))
    for field in ("vertices", "triangles", "material", "colour"):
        assert getattr(first, field).tobytes() == getattr(again, field).tobytes()
    assert first.vertices.shape != other.vertices.shape


def test_scans_far_apart_see_the_same_wall_at_the_same_place() -> None:
    drive = built_in("building")
    rig = Rig(drive, Lidar.of("vlp16"), 0, camera=False)
    ends = []
    for frame in (0, len(drive) - 1):  # in the office, before the walk and after it
        xyz = rig.frame(frame).scan.xyz
        world = xyz @ rig.poses[frame, :3, :3].T + rig.poses[frame, :3, 3]
        wall = (np.abs(world[:, 0] - 6.0 + HALF) < 0.1) & (world[:, 1] < -3.6) & (np.abs(world[:, 2] - 2.3) < 0.4)
        assert wall.sum() > 50
        ends.append(np.median(world[wall, 0]))
    assert ends == pytest.approx([6.0 - HALF] * 2, abs=0.03)


def test_the_sensor_is_as_high_as_asked_for() -> None:
    drive = built_in("building")
    lower, higher = (scene(drive, 0).poses(height) for height in (1.3, 1.6))
    np.testing.assert_allclose(higher[:, :3, 3] - lower[:, :3, 3], np.tile([0, 0, 0.3], (len(drive), 1)), atol=1e-9)
    np.testing.assert_array_equal(higher[:, :3, :3], lower[:, :3, :3])
    np.testing.assert_array_equal(Rig(drive, Lidar.of("vlp16"), 0).poses, lower)


def test_its_rooms_are_bright_in_pictures_and_no_sky_is_seen() -> None:
    rig = Rig(built_in("building"), Lidar.of("vlp16"), 0, truth=True)
    for frame in (0, 160, 350, 540):
        seen = rig.frame(frame)
        assert seen.image is not None
        assert seen.depth is not None
        assert 80 < seen.image.mean() < 170
        assert seen.image.std() > 12
        assert (seen.image == 255).mean() < 0.02
        assert seen.depth.all()
