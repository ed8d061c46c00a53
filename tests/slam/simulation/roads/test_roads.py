"""Properties of each road that make it difficult for an odometry."""

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.data.sensor import load_sensor
from slam.simulation.driven_scene import DrivenScene
from slam.simulation.drives import built_in
from slam.simulation.roads.lorries import box_truck, length_of, semi_trailer
from slam.simulation.roads.street import LorriesScene
from slam.simulation.scene import SCENES
from slam.simulation.world import StandingWorld, World

UP = np.array([0.0, 0.0, 1.0])
HEIGHT, REACH = 1.73, 80.0


def scene_of(name: str, seed: int = 0) -> DrivenScene:
    drive = built_in(name)
    found = SCENES.load(drive.scene)(drive, seed, np.random.default_rng([seed, 0]))
    assert isinstance(found, DrivenScene)
    return found


def rays(sensor: str = "hdl64", columns: int = 360) -> Array:
    """(N, 3), of unit length, as a LiDAR of that kind sends them."""
    azimuth = 2 * np.pi * (np.arange(columns) + 0.5) / columns
    rise, turn = (part.ravel() for part in np.meshgrid(load_sensor(sensor).elevation, azimuth, indexing="ij"))
    return np.column_stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])


def seen_from(scene: DrivenScene, way: float | Array, beams: Array) -> Array:
    """(N,) metres to what stands, level and ahead from the middle of the lane at that way; inf beyond REACH. Of many
    ways (N,) each sends one beam."""
    drive = scene.drive
    x, y, yaw = (np.interp(way, drive.way, part) for part in (*drive.position[:, :2].T, drive.yaw))
    c, s = np.cos(yaw), np.sin(yaw)
    turned = np.column_stack([c * beams[:, 0] - s * beams[:, 1], s * beams[:, 0] + c * beams[:, 1], beams[:, 2]])
    eye = scene.terrain.lifted(np.stack([x, y], axis=-1)) + HEIGHT * UP
    middle = np.atleast_2d(eye)[:, :2].mean(axis=0)
    reach = World(StandingWorld(scene.around(middle, REACH + np.ptp(way) + 10))).cast(eye, turned).reach
    return np.where(reach < REACH, reach, np.inf)


def differing(one: Array, other: Array, beams: Array) -> float:
    """Share of the rays that end elsewhere in the road's cross-section, by 3 cm; asphalt, which is rough, left out."""
    found = np.isfinite(one) == np.isfinite(other)
    near = np.where(np.isfinite(one) & found, one, 0), np.where(np.isfinite(other) & found, other, 0)
    apart = np.abs(near[0] - near[1]) * np.hypot(beams[:, 1], beams[:, 2])
    above = near[0] * beams[:, 2] > 0.4 - HEIGHT
    return float(np.mean(~found | (above & (apart > 0.03))))


def looks(scene: DrivenScene, ways: list[float], beams: Array) -> Array:
    """(W, N) metres: all beams from each way."""
    return seen_from(scene, np.repeat(ways, len(beams)), np.tile(beams, (len(ways), 1))).reshape(len(ways), -1)


def test_where_a_tunnel_says_so_every_place_looks_like_the_next_and_outside_its_end_shows() -> None:
    scene, beams = scene_of("tunnel"), rays()
    assert scene.drive.unobservable(REACH) == (140.0, 180.0)
    middle, *inside = looks(scene, [160.0, 142.0, 151.3, 178.0], beams)
    assert max(differing(middle, look, beams) for look in inside) < 1e-4
    outside = looks(scene, [115.0, 205.0], beams)
    assert min(differing(middle, look, beams) for look in outside) > 5e-4


def test_short_tunnels_and_other_roads_have_no_such_stretch() -> None:
    assert built_in("tunnel").unobservable(100.0) is None
    assert built_in("bridge").unobservable(REACH) is None
    assert built_in("loop").unobservable(REACH) is None


def test_a_bridge_looks_the_same_after_its_period_and_not_before() -> None:
    scene = scene_of("bridge")
    period, beams = scene.drive.period, rays()
    assert period is not None
    apart = [0.0, period, 4 * period, 1.0, 2.0]
    here, next_span, fourth, one, two = looks(scene, [101.0 + way for way in apart], beams)
    assert differing(here, next_span, beams) < 1e-4
    assert differing(here, fourth, beams) < 1e-4
    posts, lamps = differing(here, one, beams), differing(here, two, beams)
    assert posts > 0.02
    assert 0.001 < lamps < 0.5 * posts, "a step of two metres shows in the lamps alone"


def test_below_a_bridge_nothing_returns() -> None:
    scene = scene_of("bridge")
    beams = rays("vlp16")
    steep = np.concatenate([beams, beams * [1, 1, 0] + [0, 0, -1.0]])
    below = seen_from(scene, 150.0, steep / np.linalg.norm(steep, axis=1, keepdims=True)) * steep[:, 2] + HEIGHT
    assert below[np.isfinite(below)].min() > -3.0


def test_the_motorway_is_fast_from_the_first_frame_and_its_rails_follow() -> None:
    scene = scene_of("motorway")
    drive = scene.drive
    np.testing.assert_allclose(np.diff(drive.way), 3.0, atol=0.02)
    assert np.ptp(drive.yaw) > 0.1
    assert np.ptp(scene.poses(HEIGHT)[:, 2, 3]) > 4
    aside = np.array([[0, 1.0, -0.37], [0, -1.0, -0.122]])  # at the rails of the median and of the hard shoulder
    for way in (30.0, 222.0, 451.0):
        reach = seen_from(scene, way + 1.0, aside / np.linalg.norm(aside, axis=1, keepdims=True))
        across = reach / np.linalg.norm(aside, axis=1)
        np.testing.assert_allclose(across, [3.05, 8.95], atol=0.2)


def test_vehicles_of_a_motorway_overtake_and_are_overtaken() -> None:
    scene = scene_of("motorway")
    speeds = np.array([np.diff(mover.way)[0] / 0.1 for mover in scene.traffic.movers])
    assert (np.abs(speeds) > 20).all()
    assert (speeds < -20).sum() > 10
    assert ((speeds > 20) & (speeds < 29)).sum() > 10
    lengths = [length_of(mover.mesh) for mover in scene.traffic.movers]
    assert max(lengths) > 14


def test_lorries_stand_beside_the_lane_and_walls_on_both_sides() -> None:
    scene = scene_of("lorries")
    assert scene.drive.way[-1] > 88
    ways = np.arange(5.0, 120.0, 0.5)
    beside = seen_from(scene, ways, np.tile([0, -1.0, 0.2], (len(ways), 1)))
    assert np.mean(np.abs(beside - LorriesScene.ASIDE) < 0.15) > 0.6
    walls = seen_from(scene, ways, np.tile([0, 1.0, 0.4], (len(ways), 1)))
    assert np.mean((walls > 7) & (walls < 12)) > 0.8


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("sensor", ["hdl64", "vlp16"])
def test_about_every_third_echo_in_traffic_comes_from_what_moves_along(sensor: str, seed: int) -> None:
    scene = scene_of("traffic", seed)
    poses, drive, beams = scene.poses(HEIGHT), scene.drive, rays(sensor, 180)
    shares = []
    for frame in (0, 60, 120, 180, 240):
        standing = StandingWorld(scene.around(drive.position[frame, :2], REACH))
        pose, world = poses[frame], World(standing, scene.moving(frame))
        hits = world.cast(pose[:3, 3], (beams @ pose[:3, :3].T).astype(np.float32))
        shares.append(np.mean(hits.triangle[hits.reach < REACH] >= len(standing.mesh)))
    assert 0.18 < np.mean(shares) < 0.45
    along = [mover for mover in scene.traffic.movers if not mover.reverse]
    drift = [np.ptp(mover.way - drive.way) for mover in along]
    assert 0.5 < np.median(drift) < 15, "nearly as fast as the car"


def test_no_two_vehicles_of_the_traffic_touch() -> None:
    scene = scene_of("traffic")
    for frame in range(0, len(scene.drive), 50):
        boxes = [(m.way[frame], m.left, length_of(m.mesh) / 2) for m in scene.traffic.movers]
        boxes.append((scene.drive.way[frame], 0.0, 2.25))
        way, left, half = np.array(boxes).T
        gap = np.abs(way[:, None] - way) - half[:, None] - half + 1e9 * np.eye(len(way))
        assert gap[np.abs(left[:, None] - left) < 2.6].min() > 0.5


def test_lorries_are_as_long_and_high_as_lorries() -> None:
    for make, length in ((semi_trailer, (15.5, 16.7)), (box_truck, (7.4, 10.2))):
        for seed in range(4):
            size = np.ptp(make(np.random.default_rng(seed)).vertices, axis=0)
            assert length[0] < size[0] < length[1]
            assert 2.5 < size[1] < 2.9
            assert 3.3 < size[2] < 4.1
