"""The camera's pictures, held against geometry that is worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.simulation.camera import CAMERA, Look, render
from slam.simulation.mesh import Mesh, box, grid, joined, quads
from slam.simulation.world import StandingWorld, World

HEIGHT = 1.65
CLEAR = Look(
    sun=(0.0, -0.6, 0.8),
    sunlight=(3.0, 2.9, 2.7),
    zenith=(0.3, 0.4, 0.7),
    horizon=(0.9, 0.95, 1.0),
    haze=0.0005,
    cover=0.2,
    exposure=1.0,
    seed=5,
)
OVERCAST = replace(CLEAR, sunlight=(0.0, 0.0, 0.0), exposure=2.0)


def pose(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Array:
    """Pose of a camera HEIGHT above the ground that looks along x, turned to the left by `yaw`."""
    c, s = np.cos(yaw), np.sin(yaw)
    T = np.eye(4)
    T[:3, :3] = np.array([[s, 0, c], [-c, 0, s], [0, -1, 0]])
    T[:3, 3] = [x, y, HEIGHT]
    return T


def picture(mesh: Mesh, T: Array, look: Look = CLEAR, seed: int = 0) -> tuple[Array, Array]:
    return render(World(StandingWorld(mesh)), T, look, np.random.default_rng(seed))


def pixel(point: Array, T: Array) -> Array:
    """(u, v) of a point of the world through P2, which wants it in the frame of camera 0."""
    P2 = CAMERA.P2
    in_camera_2 = np.linalg.inv(T) @ [*point, 1.0]
    in_camera_0 = in_camera_2[:3] - np.linalg.solve(P2[:, :3], P2[:, 3])
    u, v, w = P2 @ [*in_camera_0, 1.0]
    return np.array([u / w, v / w])


def brightness(image: Array, point: Array, T: Array) -> float:
    """Mean of 5 x 5 pixels around a point of the world."""
    u, v = np.round(pixel(point, T)).astype(int)
    return float(image[v - 2 : v + 3, u - 2 : u + 3].mean())


def floor(material: str = "asphalt") -> Mesh:
    return quads(np.array([[[-50, -50, 0], [100, -50, 0], [100, 50, 0], [-50, 50, 0]]]), material)


def wall(material: str, yaw: float = 0.0, far: float = 0.0, pieces: int = 2) -> Mesh:
    """12 m x 5 m, facing -x, 6 m ahead of (far, far); divided into pieces in both directions."""
    y, z = np.meshgrid(np.linspace(-6, 6, pieces), np.linspace(0, 5, pieces))
    points = np.stack([np.zeros_like(y), y, z], axis=-1)
    return grid(points, material).placed(far + 6 * np.cos(yaw), far + 6 * np.sin(yaw), 0.0, yaw)


def test_depth_of_the_ground_and_of_a_wall_is_exact_along_z() -> None:
    _, depth = picture(joined([floor(), box((1, 200, 3), "plaster").placed(30.5, 0, 0)]), pose())
    rows = np.arange(CAMERA.height)
    fy, cy = CAMERA.P2[1, 1], CAMERA.P2[1, 2]
    ground = rows > cy + fy * HEIGHT / 29.9
    assert depth.shape == (375, 1242)
    assert depth.dtype == np.float32
    expected = np.broadcast_to(HEIGHT * fy / (rows[ground] - cy)[:, None], depth[ground].shape)
    np.testing.assert_allclose(depth[ground], expected, atol=1e-3)
    np.testing.assert_allclose(depth[145:210], 30.0, atol=1e-3)


def test_sky_has_no_depth() -> None:
    image, depth = picture(floor(), pose())
    assert not depth[:150].any()
    assert depth[250:].all()
    assert image.shape == (375, 1242, 3)
    assert image.dtype == np.uint8
    assert image[:100].mean() > image[250:].mean()


def test_a_surface_is_seen_where_p2_projects_its_corners() -> None:
    corners = np.array([[15.0, 3.0, 1.0], [15.0, -2.0, 1.0], [15.0, -2.0, 4.0], [15.0, 3.0, 4.0]])
    T = pose(1.0, 0.5, yaw=0.2)
    _, depth = picture(quads(corners, "sign"), T)
    rows, columns = np.nonzero(depth)
    u, v = np.array([pixel(corner, T) for corner in corners]).T
    np.testing.assert_allclose([columns.min(), columns.max()], [u.min(), u.max()], atol=1.0)
    np.testing.assert_allclose([rows.min(), rows.max()], [v.min(), v.max()], atol=1.0)


def test_a_shadow_falls_away_from_the_sun() -> None:
    plate = box((2, 2, 0.1), "concrete").placed(10.0, 0.0, 2.6)
    image, _ = picture(joined([floor(), plate]), pose())
    shadow = np.array([10.0, 0.0, 0.0]) - np.array([0.0, -0.6, 0.0]) / 0.8 * 2.65
    lit = brightness(image, shadow * [1, -1, 1], pose())
    assert brightness(image, shadow, pose()) < 0.65 * lit
    assert brightness(image, np.add(shadow, [0.0, 1.6, 0.0]), pose()) > 0.85 * lit


def test_without_sun_the_ground_is_darker_below_a_low_roof() -> None:
    roof = box((8, 8, 0.1), "concrete").placed(12.0, 0.0, 1.0)
    image, _ = picture(joined([floor(), roof]), pose(), OVERCAST)
    assert brightness(image, np.array([10.0, 0.0, 0.0]), pose()) < 0.7 * brightness(image, np.array([6, 0, 0]), pose())


@pytest.mark.parametrize("material", ["asphalt", "paving", "grass", "brick"])
def test_texture_belongs_to_the_place_and_not_to_the_view(material: str) -> None:
    places = np.stack(np.meshgrid([6.0], np.arange(-2.0, 2.0, 0.13), np.arange(0.6, 2.6, 0.11)), -1).reshape(-1, 3)
    colours = []
    for T in (pose(), pose(-0.4, 0.5, yaw=-0.05)):
        image, _ = picture(wall(material), T, OVERCAST)
        u, v = np.round([pixel(place, T) for place in places]).astype(int).T
        colours.append(image[v, u].mean(axis=1))
    assert colours[0].std() > 2.5
    assert np.corrcoef(colours)[0, 1] > 0.8
    assert abs(np.corrcoef(colours[0], colours[1][::-1])[0, 1]) < 0.4


@pytest.mark.parametrize("material", ["brick", "plaster"])
def test_texture_does_not_depend_on_how_a_wall_is_cut_into_triangles(material: str) -> None:
    far, yaw = 2000.0, 0.4
    T = pose(far, far, yaw)
    few, _ = picture(wall(material, yaw, far), T)
    many, _ = picture(wall(material, yaw, far, pieces=30), T)
    differing = np.abs(few.astype(int) - many).max(axis=2) > 6
    assert few[100:250].std() > 3.0
    assert differing.mean() < 0.002


def test_equal_seeds_give_equal_bytes() -> None:
    scene = joined([floor("grass"), box((4, 2, 1.5), "car_paint").placed(12, 1, 0)])
    first, again, other = (picture(scene, pose(), seed=seed)[0] for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_looks_are_drawn_with_the_sun_up_and_repeat_with_the_seed() -> None:
    looks = [Look.of(np.random.default_rng(seed)) for seed in range(60)]
    assert looks[7] == Look.of(np.random.default_rng(7))
    np.testing.assert_allclose([np.linalg.norm(look.sun) for look in looks], 1.0)
    assert min(look.sun[2] for look in looks) > 0.2
    assert 0 < sum(not any(look.sunlight) for look in looks) < 30
