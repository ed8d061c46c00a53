"""Scans of small worlds: where the points lie, which pulses come back, what the files look like."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import se3
from slam.data.beams import nearest_rings, recover_rings, turn_times
from slam.data.cloud import PointCloud
from slam.data.distortion import deskew
from slam.data.sensor_names import SENSORS
from slam.simulation.heads import HEADS, Lidar
from slam.simulation.lidar import Scan, exact_scan, scan
from slam.simulation.materials import INDEX, MATERIALS
from slam.simulation.mesh import Mesh, box, joined, quads
from slam.simulation.sweep import Sweep
from slam.simulation.world import StandingWorld, World

HDL64, VLP16 = Lidar.of("hdl64"), Lidar.of("vlp16")
STILL = np.eye(4)
MOTION = se3.exp(np.array([0.01, -0.02, 0.15, 1.2, 0.1, -0.05]))


def world(*parts: Mesh) -> World:
    return World(StandingWorld(joined(parts)))


def ground(height: float = -1.73, material: str = "asphalt", half: float = 150.0) -> Mesh:
    corners = [[-half, -half, height], [half, -half, height], [half, half, height], [-half, half, height]]
    return quads([corners], material)


def wall(distance: float, material: str, half: float = 30.0) -> Mesh:
    """A wall across the path ahead, as high as it is wide."""
    corners = [[distance, -half, -half], [distance, half, -half], [distance, half, half], [distance, -half, half]]
    return quads([corners], material)


def courtyard(material: str = "plaster") -> World:
    """The inside of a box, 40 m long, 24 m wide, with the sensor 1.73 m above its ground."""
    return world(box((40, 24, 30), material).placed(0, 0, -1.73), ground())


def noisy(
    where: World, lidar: Lidar = HDL64, seed: int = 0, motion: np.ndarray = STILL
) -> tuple[np.ndarray, np.ndarray]:
    seen = scan(where, lidar, Sweep.steady(np.eye(4), motion), np.random.default_rng(seed))
    return seen.xyz, seen.reflectance


def exact(where: World, lidar: Lidar = HDL64, pose: np.ndarray = STILL, motion: np.ndarray = STILL) -> Scan:
    return exact_scan(where, lidar, Sweep.steady(pose, motion))


def rays_to_the_wall(xyz: np.ndarray, tilt: float = 0.1) -> np.ndarray:
    """Ranges of the points ahead, with a direction close to +x."""
    return xyz[(xyz[:, 0] > 0) & (np.hypot(xyz[:, 1], xyz[:, 2]) < tilt * xyz[:, 0])]


@pytest.mark.parametrize("name", HEADS)
@pytest.mark.parametrize("motion", [STILL, MOTION], ids=["standing", "moving"])
def test_points_lie_on_the_lines_of_their_lasers_in_file_order(name: str, motion: np.ndarray) -> None:
    lidar = Lidar.of(name)
    sensor, seen = lidar.sensor, exact(courtyard(), lidar, motion=motion)
    xyz = seen.xyz
    ring, count = recover_rings(xyz)
    assert count == sensor.ring_count
    assert np.array_equal(ring, seen.ring)
    height = np.tan(sensor.elevation[ring]) * np.hypot(xyz[:, 0], xyz[:, 1]) + sensor.offset[ring]
    assert np.abs(xyz[:, 2] - height).max() < 1e-4
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0]) % (2 * np.pi)
    assert (np.diff(azimuth)[np.diff(ring) == 0] > 0).all()


@pytest.mark.parametrize("name", HEADS)
def test_noise_leaves_the_rings_as_they_are(name: str) -> None:
    lidar = Lidar.of(name)
    for seed in range(3):
        xyz, _ = noisy(courtyard(), lidar, seed, MOTION)
        ring, count = recover_rings(xyz)
        assert count == lidar.sensor.ring_count
        far = np.hypot(xyz[:, 0], xyz[:, 1]) > 6
        assert np.array_equal(nearest_rings(xyz[far], lidar.sensor), ring[far])


def test_deskewing_undoes_the_motion() -> None:
    pose = se3.exp(np.array([0.02, 0.01, 0.7, 2.0, -1.0, 0.3]))
    xyz = exact(courtyard(), HDL64, pose, MOTION).xyz
    cloud = PointCloud(xyz, np.zeros(len(xyz)), time=turn_times(xyz, 0.1))
    assert _off_the_courtyard(deskew(cloud, se3.log(MOTION) / 0.1).xyz, pose).max() < 2e-3
    assert np.percentile(_off_the_courtyard(xyz, pose), 90) > 0.1  # and it was bent before


def _off_the_courtyard(xyz: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Distance [m] of points from the nearest of its walls, ground and ceiling."""
    x, y, z = (xyz @ pose[:3, :3].T + pose[:3, 3]).T
    faces = [np.abs(x) - 20, np.abs(y) - 12, z + 1.73, z - 28.27]
    return np.min(np.abs(faces), axis=0)


def test_what_is_ahead_is_seen_at_mid_sweep_and_what_is_left_of_it_before() -> None:
    forward = se3.exp(np.array([0, 0, 0, 1.2, 0, 0]))
    xyz = exact(world(wall(15, "plaster")), motion=forward).xyz
    azimuth = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0]))
    for at, distance in ((0, 15.0), (45, 15.15), (-45, 14.85)):  # an eighth of a turn: an eighth of the way
        assert xyz[np.abs(azimuth - at) < 0.5, 0] == pytest.approx(distance, abs=0.003)


def test_a_wall_is_as_thick_as_the_ranges_are_wrong() -> None:
    flat = rays_to_the_wall(noisy(world(wall(12, "plaster")))[0])
    ring = nearest_rings(flat, HDL64.sensor)
    assert flat[:, 0].std() == pytest.approx(0.02, abs=0.006)
    within = [flat[ring == k, 0].std() for k in np.unique(ring)]
    assert np.median(within) < 0.012  # most of it is from laser to laser


def test_fewer_pulses_come_back_from_the_dark_the_grazed_and_the_far() -> None:
    by_material = [_share_seen(world(ground(material=name)), 20, 79) for name in ("sign", "grass", "asphalt", "tyre")]
    by_height = [_share_seen(world(ground(height=height)), 20, 79) for height in (-12, -3.5, -1.73)]
    by_range = [_share_seen(world(ground()), *limits) for limits in ((10, 20), (30, 45), (45, 60), (60, 79))]
    for shares in (by_material, by_height, by_range):
        assert (np.diff(shares) < -0.02).all()


def test_asphalt_is_seen_as_far_as_on_kitti() -> None:
    road = world(ground())
    assert _share_seen(road, 20, 30) > 0.93
    assert 0.4 < _share_seen(road, 45, 60) < 0.85
    assert _share_seen(road, 70, 79) < 0.4


def _share_seen(where: World, nearest: float, farthest: float) -> float:
    """Share of the pulses in the quarter ahead that hit something at these ranges."""
    seen, there = (_ahead_at(xyz, nearest, farthest).sum() for xyz in (noisy(where)[0], exact(where).xyz))
    return float(seen / there)


def _ahead_at(xyz: np.ndarray, nearest: float, farthest: float) -> np.ndarray:
    """Mask of the points in the quarter ahead at those ranges, seen by rings above what the own car hides."""
    reach = np.linalg.norm(xyz, axis=1)
    return (xyz[:, 0] > np.abs(xyz[:, 1])) & (xyz[:, 2] > -0.35 * reach) & (reach > nearest) & (reach < farthest)


def test_facades_are_seen_at_any_range() -> None:
    flat = world(wall(76, "plaster"))
    seen, there = noisy(flat)[0], exact(flat).xyz
    assert len(rays_to_the_wall(seen)) > 0.95 * len(rays_to_the_wall(there))


def test_glass_loses_pulses_as_its_material_says() -> None:
    window, plaster = (len(rays_to_the_wall(noisy(world(wall(12, name)))[0])) for name in ("glass", "plaster"))
    kept = 1 - MATERIALS[INDEX["glass"]].lost
    assert abs(window / plaster - kept) < 0.08


def test_what_is_too_near_or_too_far_is_not_seen() -> None:
    assert len(noisy(world(wall(0.7, "plaster", 0.2)))[0]) == 0
    assert len(noisy(world(wall(81, "plaster", 200)))[0]) == 0
    assert len(noisy(world(wall(81, "plaster", 200)), VLP16)[0]) > 0


def test_mixed_pixels_hang_between_the_surfaces_at_an_edge() -> None:
    front = quads([[[10, 0, -9], [10, 30, -9], [10, 30, 9], [10, 0, 9]]], "plaster")  # over the left half of the view
    x = rays_to_the_wall(noisy(world(front, wall(12, "plaster")))[0], 0.2)
    hanging = (x[:, 0] > 10.15) & (x[:, 0] < 11.85)
    assert 3 < hanging.sum() < HDL64.sensor.ring_count  # at most one a ring, and not in all
    assert (np.abs(x[hanging, 1]) < 0.08).all()  # within a column or two of the edge
    assert x[:, 0].min() > 9.85
    assert x[:, 0].max() < 12.15

    far = rays_to_the_wall(noisy(world(front, wall(20, "plaster")))[0], 0.2)[:, 0]
    assert not ((far > 10.2) & (far < 19.8)).any()  # such echoes come one after the other


def test_reflectances_tell_materials_apart_in_kittis_steps() -> None:
    values = {name: noisy(world(wall(12, name)))[1] for name in ("tyre", "asphalt", "plaster", "sign")}
    assert list(values) == sorted(values, key=lambda name: float(np.median(values[name])))
    for reflectance in values.values():
        assert reflectance.dtype == np.float32
        assert reflectance.min() >= 0
        assert reflectance.max() <= np.float32(0.99)
        assert np.abs(100 * reflectance - np.round(100 * reflectance)).max() < 1e-4


def test_coordinates_are_whole_millimetres() -> None:
    xyz, _ = noisy(courtyard())
    assert xyz.dtype == np.float32
    assert np.abs(1000 * xyz.astype(float) - np.round(1000 * xyz.astype(float))).max() < 5e-3


def test_the_car_hides_what_is_behind_its_roof_and_no_ring_wholly() -> None:
    xyz, _ = noisy(courtyard("concrete"))
    ring, _ = recover_rings(xyz)
    counts = np.bincount(ring)
    assert counts[:45].min() > 2000
    assert 1100 < counts[63] < counts[56] < counts[45]


def test_a_seed_gives_the_same_bytes_and_draws_as_often_whatever_is_seen() -> None:
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    moving, standing = Sweep.steady(np.eye(4), MOTION), Sweep.steady(np.eye(4), STILL)
    first, again = (scan(courtyard(), HDL64, moving, rng) for rng in (one, other))
    assert [first.xyz.tobytes(), first.reflectance.tobytes()] == [again.xyz.tobytes(), again.reflectance.tobytes()]
    scan(courtyard(), HDL64, standing, one)
    scan(world(wall(60, "tyre")), HDL64, standing, other)
    assert one.random() == other.random()
    assert noisy(courtyard(), seed=4)[0].tobytes() != first.xyz.tobytes()


def test_a_scan_of_the_sky_is_empty() -> None:
    xyz, reflectance = noisy(world(wall(500, "plaster")))
    assert xyz.shape == (0, 3)
    assert reflectance.shape == (0,)


@pytest.mark.parametrize("name", HEADS)
def test_lasers_look_aside_of_where_the_head_points(name: str) -> None:
    lidar = Lidar.of(name)
    seen = exact(courtyard(), lidar, motion=MOTION)
    head = (0.5 - seen.fraction) * 2 * np.pi
    aside = np.arctan2(seen.xyz[:, 1], seen.xyz[:, 0]) - head - lidar.sensor.azimuth[seen.ring]
    assert np.abs((aside + np.pi) % (2 * np.pi) - np.pi).max() < 1e-4
    assert seen.fraction.min() >= 0
    assert seen.fraction.max() <= 1


@pytest.mark.parametrize(
    ("name", "rate", "columns"),
    [("vlp16", 10, 1800), ("vlp16", 20, 900), ("vlp32c", 5, 3600), ("os1-64", 10, 1024), ("os1-128", 20, 1024)],
)
def test_columns_of_a_turn_as_the_real_ones_have(name: str, rate: float, columns: int) -> None:
    seen = exact(courtyard(), Lidar.of(name, rate))
    assert set(np.bincount(seen.ring)) == {columns}


def test_an_os1_fires_all_lasers_at_once_and_a_velodyne_one_after_the_other() -> None:
    for name, together in (("os1-64", True), ("vlp32c", False)):
        lidar = Lidar.of(name)
        seen = exact(courtyard(), lidar)
        within = (seen.fraction * lidar.columns) % 1  # of a column; the same for a laser in all columns
        of_a_laser = np.array([np.angle(np.exp(2j * np.pi * within[seen.ring == ring]).mean()) for ring in range(32)])
        spread = np.abs(np.exp(1j * of_a_laser).mean())
        assert (spread > 0.8) == together


def test_every_sensor_to_simulate_has_a_head() -> None:
    assert list(HEADS) == SENSORS.names()
