"""Odometry on scans of a spinning LiDAR, in observable and degenerate scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from slam.cell_sizes import choose_sizes
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.odometry import Odometry, OdometryStep
from slam.registration.ndt import NdtTarget
from slam.registration.result import RegistrationResult
from slam.settings import OdometrySettings

Scene = Literal["tunnel", "plane", "street", "corridor"]
Face = tuple[int, float, Array, Array]  # normal axis of a rectangle, position along it, minimum and maximum corner

ELEVATION = {16: np.deg2rad(np.linspace(15, -15, 16)), 64: np.deg2rad(np.linspace(2, -24.8, 64))}
COLUMNS = 720
REACH, NOISE = 40.0, 0.02  # m
SPEED = 1.5  # m a scan


# ---- scenes; x ahead, the ground 1.7 m below the sensor


def face(axis: int, at: float, low: Sequence[float], high: Sequence[float]) -> Face:
    return axis, at, np.array(low, float), np.array(high, float)


def box(low: Sequence[float], high: Sequence[float]) -> list[Face]:
    return [face(axis, side[axis], low, high) for axis in range(3) for side in (low, high)]


GROUND = face(2, -1.7, [-1e3, -1e3, -2], [1e3, 1e3, 2])
ENTRANCE = 27.3  # m; pillars until there, nothing beyond


def tube(width: float, height: float) -> list[Face]:
    """Along x, with open ends."""
    low, high = [-1e3, -width / 2 - 1, -2], [1e3, width / 2 + 1, height]
    walls = [face(1, side * width / 2, low, high) for side in (-1, 1)]
    return [face(2, -1.7, low, high), face(2, height - 1.7, low, high), *walls]


def pillars() -> list[Face]:
    along = (-37, -31, -26, -22, -18, -12, -7, -2, 3, 7, 12, 16, 19, ENTRANCE - 1.3)
    places = zip(along, (3.5, -5) * 7, strict=True)
    return [one for x, y in places for one in box([x, y, -1.7], [x + 1.3, y + 1.5, 4])]


def street() -> list[Face]:
    """Houses at different distances from the road, with gaps, and cars in front of them."""
    rng, faces = np.random.default_rng(3), [GROUND]
    for side in (-1, 1):
        x = -45.0
        while x < 90:
            width, y = rng.uniform(6, 12), side * rng.uniform(7, 11)
            ends = sorted((y, side * 20))
            faces += box([x, ends[0], -1.7], [x + width, ends[1], 7])
            car = sorted((side * 3.6, side * 5.2))
            faces += box([x, car[0], -1.5], [x + 3.9, car[1], -0.2])
            x += width + rng.uniform(1, 4)
    return faces


SCENES: dict[Scene, list[Face]] = {
    "tunnel": [*tube(10, 5.7), *pillars()],
    "plane": [GROUND],
    "street": street(),
    "corridor": [*tube(2.2, 2.8), *(face(0, end, [-7, -2, -2], [7, 2, 2]) for end in (-6, 6))],
}


@cache
def scan(scene: Scene, rings: int, x: float, seed: int) -> PointCloud:
    """A scan of a level sensor at (x, 0, 0), ring by ring."""
    elevation, azimuth = np.meshgrid(ELEVATION[rings], np.arange(COLUMNS) / COLUMNS * 2 * np.pi, indexing="ij")
    flat = np.cos(elevation)
    beams = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1).reshape(-1, 3)
    origin, reach = np.array([x, 0, 0]), np.full(len(beams), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, at, low, high in SCENES[scene]:
            t = (at - origin[axis]) / beams[:, axis]
            hit = origin + t[:, None] * beams
            others = [other for other in range(3) if other != axis]
            inside = ((low <= hit) & (hit <= high))[:, others].all(axis=1) & (t > 0)
            reach = np.where(inside, np.minimum(reach, t), reach)
    seen = reach < REACH
    reach = reach[seen] + np.random.default_rng(seed).normal(0, NOISE, int(seen.sum()))
    return PointCloud(beams[seen] * reach[:, None], np.ones(len(reach)))


# ---- drives along x


def drive(
    scene: Scene, rings: int, metres: Array, stamps: Array | None = None, settings: OdometrySettings | None = None
) -> list[OdometryStep]:
    """The steps, with the revised ones in place of the provisional ones."""
    odometry, steps = Odometry(settings or OdometrySettings()), list[OdometryStep]()
    times = 0.1 * np.arange(len(metres)) if stamps is None else stamps
    for seed, (x, time) in enumerate(zip(metres, times, strict=True)):
        step = odometry.register(scan(scene, rings, float(x), seed), float(time))
        steps[len(steps) - len(step.revised) :] = [*step.revised, step]
    settled = odometry.settle()
    steps[len(steps) - len(settled) :] = settled
    return steps


def evenly(frames: int, speed: float = SPEED) -> Array:
    return speed * np.arange(frames)


def poses_of(steps: Sequence[OdometryStep]) -> Array:
    return np.array([step.pose for step in steps])


def ahead(steps: Sequence[OdometryStep]) -> Array:
    """Motions (N - 1,) [m] along the sensor's x axis."""
    poses = poses_of(steps)
    return (se3.inverse(poses[:-1]) @ poses[1:])[:, 0, 3]


def off(steps: Sequence[OdometryStep], metres: Array) -> Array:
    """Position errors (N, 3) [m]."""
    return np.asarray(poses_of(steps)[:, :3, 3] - np.outer(metres, [1, 0, 0]))


# ---- a bare tunnel

IN_SIGHT = evenly(60) < ENTRANCE + 20  # frames in which pillars with many points are visible
INSIDE = evenly(60) > ENTRANCE + REACH + SPEED  # frames in which the pillars in the map are out of range too


@pytest.fixture(scope="module", params=[16, 64])
def rings(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def through_tunnel(rings: int) -> list[OdometryStep]:
    return drive("tunnel", rings, evenly(60))


def test_the_axis_of_a_bare_tunnel_is_reported(through_tunnel: list[OdometryStep]) -> None:
    statuses = np.array([step.status for step in through_tunnel])
    assert np.isin(statuses[IN_SIGHT], ["registered", "retried"]).all()
    assert (statuses[INSIDE] == "degenerate").all()
    for step in np.array(through_tunnel, object)[INSIDE]:
        (direction,) = step.unobserved
        assert (direction[:3] == 0).all()
        assert abs(direction[3]) > np.cos(np.deg2rad(10))


def test_the_last_speed_is_kept_in_a_tunnel(through_tunnel: list[OdometryStep]) -> None:
    """To 2 % in the tunnel: registrations before it hardly constrain the axis. The walls constrain the rest."""
    inside = np.flatnonzero(INSIDE)[1:] - 1
    np.testing.assert_allclose(ahead(through_tunnel)[inside], SPEED, rtol=0.02)
    along, across = np.abs(off(through_tunnel, evenly(60))[:, :2]).T
    assert along[IN_SIGHT].max() < 0.1
    assert along.max() < 0.5
    assert across.max() < 0.1


def test_the_covariance_grows_along_unobservable_directions(through_tunnel: list[OdometryStep]) -> None:
    """Along the axis from frame to frame, until it is observable again; not across the axis."""
    spread = np.sqrt([np.diag(step.covariance)[3:] for step in np.array(through_tunnel, object)[INSIDE]])
    assert (np.diff(spread[:, 0]) > 0).all()
    assert spread[-1, 0] > 1.5 * spread[0, 0]
    assert spread[:, 1:].max() < 0.02
    assert spread[-1, 0] > 3 * spread[:, 1:].max()


@pytest.mark.parametrize("change", [0.3, -0.3])
def test_an_unobservable_acceleration_is_within_the_covariance(rings: int, change: float) -> None:
    """0.3 m/s^2 for two seconds inside the tunnel: the errors of each motion and of all motions together."""
    speeds = np.full(59, SPEED)
    inside = np.flatnonzero(INSIDE)
    speeds[inside[1:] - 1] += 0.01 * change * np.arange(1, len(inside))
    metres = np.concatenate([[0], np.cumsum(speeds)])[: inside[0] + 14]
    steps = drive("tunnel", rings, metres)
    held = slice(int(inside[0]), None)
    errors = (ahead(steps) - np.diff(metres))[held]
    variances = np.array([step.covariance[3, 3] for step in steps[1:]])[held]
    assert (errors**2 < 9 * variances).all()
    assert abs(errors.sum()) < 3 * np.sqrt(variances).sum()


def test_without_the_check_the_tunnel_is_tracked_wrongly(rings: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests above do depend on the check."""
    monkeypatch.setattr(NdtTarget, "unobserved", lambda *_: np.zeros((0, 3)))
    steps = drive("tunnel", rings, evenly(60))
    assert not np.allclose(ahead(steps)[np.flatnonzero(INSIDE)[1:] - 1], SPEED, rtol=0.02)
    assert abs(off(steps, evenly(60))[-1, 0]) > 5
    variances = np.array([step.covariance[3, 3] for step in steps[1:]])
    assert np.mean(((ahead(steps) - SPEED) ** 2 / variances)[INSIDE[1:]]) > 9  # with a small sigma


def test_the_velocity_of_one_wrong_registration_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last scan with an observable axis is registered 20 cm too far ahead: this velocity is not kept."""
    frame, align, unobserved = 0, NdtTarget.align, NdtTarget.unobserved

    def slipping(target: NdtTarget, *arguments: Array) -> RegistrationResult:
        found = align(target, *arguments)
        slip = np.eye(4)
        slip[0, 3] = 0.2 * (frame == 13)
        return replace(found, pose=slip @ found.pose)

    def lost(target: NdtTarget, *arguments: Array) -> Array:
        return np.eye(3)[:1] if frame > 13 else unobserved(target, *arguments)

    monkeypatch.setattr(NdtTarget, "align", slipping)
    monkeypatch.setattr(NdtTarget, "unobserved", lost)
    odometry, steps = Odometry(OdometrySettings()), []
    for frame, x in enumerate(evenly(18)):
        steps.append(odometry.register(scan("street", 64, float(x), frame), 0.1 * frame))
    assert [step.status for step in steps[14:]] == ["degenerate"] * 4
    np.testing.assert_allclose(ahead(steps)[13:], SPEED, atol=0.02)


def test_all_directions_of_a_street_with_houses_are_observable(rings: int) -> None:
    steps = drive("street", rings, evenly(30))
    assert [step.status for step in steps] == ["registered"] * 30
    assert all(step.unobserved.shape == (0, 6) for step in steps)
    assert np.abs(off(steps, evenly(30))[:, :2]).max() < 0.05
    assert np.ptp(off(steps, evenly(30))[1:, 2]) < 0.1  # the first motion is tested separately


def test_the_covariance_of_the_first_motion_is_consistent(rings: int) -> None:
    """Sixteen rings of one scan hardly constrain the height, and the covariance has to be large."""
    step = drive("street", rings, evenly(2))[1]
    error = se3.log(se3.inverse(step.pose) @ se3.exp(np.array([0, 0, 0, SPEED, 0, 0])))
    assert (np.abs(error) < 4 * np.sqrt(np.diag(step.covariance)) + 0.01).all()


# ---- nothing but the ground


@pytest.fixture(scope="module")
def over_plane() -> list[OdometryStep]:
    return drive("plane", 64, evenly(20))


def test_over_a_plane_two_directions_and_the_yaw_are_unobservable(over_plane: list[OdometryStep]) -> None:
    for step in over_plane[1:]:
        assert step.status == "degenerate"
        assert step.unobserved.shape == (3, 6)
        np.testing.assert_allclose(step.unobserved @ step.unobserved.T, np.eye(3), atol=1e-9)
        turn = np.abs(step.unobserved[:, 2]).argmax()
        np.testing.assert_allclose(np.abs(step.unobserved[turn]), [0, 0, 1, 0, 0, 0], atol=0.05)
        moves = np.delete(step.unobserved, turn, axis=0)
        assert np.abs(moves[:, [0, 1, 2, 5]]).max() < 0.05


def test_over_a_plane_no_motion_is_estimated(over_plane: list[OdometryStep]) -> None:
    """No translation and no yaw, which are unknown; height, pitch and roll are observable."""
    poses = poses_of(over_plane)
    motions = np.array([se3.log(motion) for motion in se3.inverse(poses[:-1]) @ poses[1:]])
    assert np.linalg.norm(motions[:, 3:], axis=1).max() < 0.05
    assert np.rad2deg(np.abs(motions[:, :3])).max() < 0.2
    assert np.abs(poses[:, 2, 3]).max() < 0.02
    for step in over_plane[2:]:
        spread = np.sqrt(np.diag(step.covariance))
        assert min(spread[3:5]) > 3 * spread[5]


# ---- clocks


@pytest.fixture(scope="module")
def along_street() -> list[OdometryStep]:
    return drive("street", 16, evenly(24))


@pytest.mark.parametrize("seconds", [2.0, 37.0, 3600.0, -2.0])
def test_a_stepped_clock_does_not_affect_poses(along_street: list[OdometryStep], seconds: float) -> None:
    stamps = 0.1 * np.arange(24) + np.where(np.arange(24) >= 12, seconds, 0)
    steps = drive("street", 16, evenly(24), stamps)
    assert "failed" not in [step.status for step in steps]
    apart = np.linalg.norm(poses_of(steps)[:, :3, 3] - poses_of(along_street)[:, :3, 3], axis=1)
    assert apart.max() < 0.02


@pytest.mark.parametrize(
    "stamps",
    [
        pytest.param(1e-6 * np.arange(24), id="all"),
        pytest.param(np.sort(np.append(0.1 * np.arange(23), 1.1 + 1e-6)), id="one"),
    ],
)
def test_stamps_a_microsecond_apart_do_not_affect_poses(along_street: list[OdometryStep], stamps: Array) -> None:
    steps = drive("street", 16, evenly(24), stamps)
    assert "failed" not in [step.status for step in steps]
    apart = np.linalg.norm(poses_of(steps)[:, :3, 3] - poses_of(along_street)[:, :3, 3], axis=1)
    assert apart.max() < 0.02


def test_odometry_is_deterministic(along_street: list[OdometryStep]) -> None:
    again = drive("street", 16, evenly(24))
    np.testing.assert_array_equal(poses_of(again), poses_of(along_street))
    for one, other in zip(again, along_street, strict=True):
        np.testing.assert_array_equal(one.covariance, other.covariance)


# ---- sizes


@pytest.mark.parametrize("rings", [16, 64])
def test_cells_of_a_corridor_are_finer_than_those_of_a_street(rings: int) -> None:
    clouds = (scan(scene, rings, 0.0, 0).xyz for scene in ("corridor", "street"))
    narrow, wide = (choose_sizes(OdometrySettings(), xyz) for xyz in clouds)
    for name in ("voxel_size", "map_voxel_size", "min_range"):
        assert getattr(narrow, name) < 0.7 * getattr(wide, name)
    assert list(narrow.cell_sizes) < [0.7 * size for size in wide.cell_sizes]
    assert list(narrow.cell_sizes) == sorted(narrow.cell_sizes, reverse=True)


def test_sizes_in_the_settings_are_kept() -> None:
    cloud = scan("corridor", 16, 0.0, 0).xyz
    chosen = choose_sizes(OdometrySettings(), cloud)
    assert choose_sizes(OdometrySettings(cell_sizes=(3.0, 1.2)), cloud).cell_sizes == (3.0, 1.2)
    for name in ("voxel_size", "map_voxel_size", "min_range"):
        found = choose_sizes(OdometrySettings.model_validate({name: 0.77}), cloud)
        assert getattr(found, name) == 0.77
        assert found.cell_sizes == chosen.cell_sizes
    assert choose_sizes(OdometrySettings(min_range=0.0), cloud).min_range == 0.0


def test_sizes_are_chosen_from_the_first_scan() -> None:
    first, second = (scan(scene, 16, 0.0, 0) for scene in ("corridor", "street"))
    odometry = Odometry(OdometrySettings())
    odometry.register(PointCloud(np.zeros((0, 3)), np.zeros(0)), 0.0)
    assert odometry.sizes is None
    for time, cloud in ((0.1, first), (0.2, second)):
        odometry.register(cloud, time)
        assert odometry.sizes == choose_sizes(OdometrySettings(), first.xyz)


@pytest.mark.parametrize("factor", [0.75, 1.5])
def test_other_sizes_track_the_sequence(rings: int, factor: float) -> None:
    chosen = choose_sizes(OdometrySettings(), scan("street", rings, 0.0, 0).xyz)
    scaled = {
        "cell_sizes": tuple(factor * size for size in chosen.cell_sizes),
        **{name: factor * getattr(chosen, name) for name in ("voxel_size", "map_voxel_size")},
    }
    steps = drive("street", rings, evenly(30), settings=OdometrySettings.model_validate(scaled))
    assert "failed" not in [step.status for step in steps]
    assert np.abs(off(steps, evenly(30))[:, :2]).max() < 0.1


@pytest.mark.parametrize(("chosen", "few"), [(None, False), (0.6, True)])
def test_in_a_narrow_place_the_points_of_the_map_are_registered(
    monkeypatch: pytest.MonkeyPatch, chosen: float | None, few: bool
) -> None:
    counts, align = list[int](), NdtTarget.align

    def counted(self: NdtTarget, xyz: Array, *arguments: Array) -> RegistrationResult:
        counts.append(len(xyz))
        return align(self, xyz, *arguments)

    monkeypatch.setattr(NdtTarget, "align", counted)
    odometry = Odometry(OdometrySettings(voxel_size=chosen))
    for number in range(3):
        odometry.register(scan("corridor", 16, 0.0, number), 0.1 * number)
    assert (counts[-1] < 500) == few
