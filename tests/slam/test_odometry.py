"""Odometry in a synthetic street and on real sequences."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from slam.config import load_config
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.dataset import Dataset, open_dataset
from slam.odometry import Odometry, OdometryStep
from slam.settings import OdometrySettings
from slam.simulation.simulation import Simulation, SimulationConfig

RealData = Callable[[str], Path]

SPEED = 1.4  # m a frame
HEADING = 0.01  # rad a frame


# ---- a street: ground, house fronts at varying distance, parked cars and poles


def street() -> tuple[Array, Array, Array]:
    """Corners, and two edges of each rectangle, all (F, 3)."""
    rng, faces = np.random.default_rng(42), [([-60, -30, -1.7], [180, 0, 0], [0, 60, 0])]
    for side in (-1, 1):
        x = -60.0
        while x < 120:
            width, depth = rng.uniform(5, 12), side * rng.uniform(8, 12)
            faces.append(([x, depth, -1.7], [width, 0, 0], [0, 0, 7]))
            faces.append(([x, depth, -1.7], [0, side * 4, 0], [0, 0, 7]))
            x += width
        for x in rng.uniform(-60, 120, 25):
            y, (a, b, c) = side * rng.uniform(4, 7), rng.uniform([0.3, 0.3, 1], [4, 1.6, 3])
            for corner, u, v in (
                ([x, y, -1.7], [a, 0, 0], [0, 0, c]),
                ([x, y + b, -1.7], [a, 0, 0], [0, 0, c]),
                ([x, y, -1.7], [0, b, 0], [0, 0, c]),
                ([x + a, y, -1.7], [0, b, 0], [0, 0, c]),
            ):
                faces.append((corner, u, v))
    corners, u, v = (np.array(column, float) for column in zip(*faces, strict=True))
    return corners, u, v


def tunnel() -> tuple[Array, Array, Array]:
    """A bare tunnel along x, with ends out of range."""
    low, along, across, up = [-90, -5, -1.7], [240, 0, 0], [0, 10, 0], [0, 0, 5.7]
    faces = [(low, along, across), ([-90, -5, 4], along, across), (low, along, up), ([-90, 5, -1.7], along, up)]
    corners, u, v = (np.array(column, float) for column in zip(*faces, strict=True))
    return corners, u, v


STREET, TUNNEL = street(), tunnel()


def scan(pose: Array, seed: int, density: float = 6.0, reach: float = 35.0, faces: tuple = STREET) -> PointCloud:
    """A scan of the street at `pose`, sampled again, with 1 cm noise."""
    rng, (corner, u, v) = np.random.default_rng(seed), faces
    count = (density * np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)).astype(int)
    face = np.repeat(np.arange(len(corner)), count)
    a, b = rng.random((2, len(face), 1))
    xyz = corner[face] + a * u[face] + b * v[face] - pose[:3, 3]
    xyz = xyz[np.linalg.norm(xyz, axis=1) < reach]
    xyz = (xyz + rng.normal(0, 0.01, xyz.shape)) @ pose[:3, :3]
    return PointCloud(xyz, np.ones(len(xyz)))


def noise(seed: int) -> PointCloud:
    xyz = np.random.default_rng(seed).uniform([-30, -30, -2], [30, 30, 8], (20_000, 3))
    return PointCloud(xyz, np.ones(len(xyz)))


EMPTY = PointCloud(np.zeros((0, 3)), np.zeros(0))


def drive(frames: int, speed: float = SPEED) -> Array:
    """True poses (N, 4, 4), a gentle bend at constant speed."""
    step = se3.exp(np.array([0, 0, HEADING, speed, 0, 0]))
    poses = [np.eye(4)]
    for _ in range(frames - 1):
        poses.append(poses[-1] @ step)
    return np.array(poses)


def error(step: OdometryStep, truth: Array) -> float:
    return float(np.linalg.norm(step.pose[:3, 3] - truth[:3, 3]))


def settings(**values: object) -> OdometrySettings:
    return OdometrySettings.model_validate({"voxel_size": 0.8, **values})


def drive_with(odometry: Odometry, truth: Array, instead: dict[int, PointCloud] | None = None) -> list[OdometryStep]:
    clouds = instead or {}
    return registered(odometry, (clouds.get(i, scan(T, i)) for i, T in enumerate(truth)))


def registered(odometry: Odometry, clouds: Iterable[PointCloud]) -> list[OdometryStep]:
    """The steps of scans one sweep apart, with the revised ones in place of the provisional ones."""
    steps: list[OdometryStep] = []
    for i, cloud in enumerate(clouds):
        step = odometry.register(cloud, 0.1 * i)
        steps[len(steps) - len(step.revised) :] = [*step.revised, step]
    return steps


@pytest.fixture(scope="module")
def steps() -> list[OdometryStep]:
    return drive_with(Odometry(settings()), drive(20))


def test_constant_speed_is_tracked(steps: list[OdometryStep]) -> None:
    """From the first frame on, without a known speed, at 1.4 m per frame."""
    assert [step.status for step in steps] == ["registered"] * 20
    for step, truth in zip(steps, drive(20), strict=True):
        assert error(step, truth) < 0.05
        assert np.rad2deg(se3.angle(se3.inverse(truth) @ step.pose)) < 0.2


def test_the_first_scan_is_the_origin(steps: list[OdometryStep]) -> None:
    np.testing.assert_array_equal(steps[0].pose, np.eye(4))
    assert steps[0].registration is None
    assert all(step.registration is not None for step in steps[1:])


def test_the_covariance_of_the_motion_is_consistent(steps: list[OdometryStep]) -> None:
    """NEES per degree of freedom: its mean is 1 for a consistent covariance."""
    motions, truths = (se3.inverse(p[:-1]) @ p[1:] for p in (np.array([step.pose for step in steps]), drive(20)))
    errors = [se3.log(se3.inverse(found) @ true) for found, true in zip(motions, truths, strict=True)]
    squares = [e @ np.linalg.solve(step.covariance, e) / 6 for e, step in zip(errors[3:], steps[4:], strict=True)]
    assert 0.3 < np.mean(squares) < 3


def test_covariance_of_registered_scans_is_small_and_positive_definite(steps: list[OdometryStep]) -> None:
    for step in steps[1:]:
        assert np.linalg.eigvalsh(step.covariance)[0] > 0
        assert np.sqrt(np.diag(step.covariance)[3:]).max() < 0.1


def test_the_velocity_is_predicted() -> None:
    odometry = Odometry(settings())
    truth = drive(8)
    drive_with(odometry, truth[:6])
    assert np.linalg.norm(odometry.predict(0.6)[:3, 3] - truth[6, :3, 3]) < 0.1
    assert np.linalg.norm(odometry.predict(0.7)[:3, 3] - truth[7, :3, 3]) < 0.2


@pytest.mark.parametrize("bad", ["empty", "noise", "few", "nan"])
def test_a_failed_scan_keeps_the_prediction(bad: str) -> None:
    truth, odometry = drive(14), Odometry(settings())
    nan = PointCloud(np.full((500, 3), np.nan), np.ones(500))
    cloud = {"empty": EMPTY, "noise": noise(0), "few": noise(0).select(np.arange(20)), "nan": nan}[bad]
    drive_with(odometry, truth[:8])
    predicted, size = odometry.predict(0.8), len(odometry.target)
    step = odometry.register(cloud, 0.8)
    assert step.status == "failed"
    np.testing.assert_allclose(step.pose, predicted, atol=1e-9)
    assert np.sqrt(np.diag(step.covariance)[3:]).min() >= 1.0
    assert len(odometry.target) == size  # the scan is not in the map
    for i in range(9, 14):
        step = odometry.register(scan(truth[i], i), 0.1 * i)
        assert step.status != "failed"
        assert error(step, truth[i]) < 0.05


@pytest.mark.parametrize(("faces", "status"), [(STREET, "registered"), (TUNNEL, "failed")], ids=["street", "tunnel"])
def test_a_registration_with_a_large_sigma_along_one_direction_is_rejected(faces: tuple, status: str) -> None:
    """Both fit almost perfectly, but in the tunnel the sigma along the axis is four times as large."""
    odometry = Odometry(settings(max_position_sigma=0.005))
    odometry.register(scan(np.eye(4), 0, faces=faces), 0.0)
    step = odometry.register(scan(drive(2)[1], 1, faces=faces), 0.1)
    assert step.registration is not None
    assert step.registration.inlier_ratio > 0.8
    assert step.status == status


def test_tracking_starts_after_a_failed_first_scan() -> None:
    truth, odometry = drive(6), Odometry(settings())
    assert odometry.register(EMPTY, -0.1).status == "failed"
    found = drive_with(odometry, truth)
    assert [step.status for step in found] == ["registered"] * 6
    assert error(found[-1], truth[-1]) < 0.05


@pytest.mark.parametrize(
    "preset",
    [None, "scan-to-scan", "icp"],
)
def test_tracking_continues_after_many_empty_scans(preset: str | None) -> None:
    """Enough of them to restart the map: every scan has a step, and the rest of the sequence is tracked."""
    truth, odometry = drive(24), Odometry(load_config(preset).odometry)
    found = drive_with(odometry, truth, dict.fromkeys(range(8, 16), EMPTY))
    assert [step.status for step in found[8:16]] == ["failed"] * 8
    assert all(step.status != "failed" for step in found[18:])
    moved, true = (se3.inverse(a) @ b for a, b in ((found[18].pose, found[23].pose), (truth[18], truth[23])))
    assert np.linalg.norm(moved[:3, 3] - true[:3, 3]) < 0.5


def test_empty_scans_do_not_remove_the_map() -> None:
    truth, odometry = drive(17), Odometry(settings())
    step = drive_with(odometry, truth, dict.fromkeys(range(8, 16), EMPTY))[-1]
    assert error(step, truth[-1]) < 0.1


def test_acceleration_during_empty_scans_is_tracked() -> None:
    """The car gains 6 m/s during three empty scans: 1.8 m off the prediction, within the search radius."""
    odometry, x, errors = Odometry(settings()), 0.0, []
    for i in range(22):
        truth = np.eye(4)
        truth[0, 3] = x
        errors.append(error(odometry.register(EMPTY if 8 <= i < 11 else scan(truth, i), 0.1 * i), truth))
        x += 1.0 if i < 8 else 1.6
    assert max(errors[-5:]) < 0.3


@pytest.mark.parametrize("degrees", [3.0, 5.0, 7.0, 9.0, 13.0, 18.0])
def test_an_abrupt_turn_is_found_or_the_scan_fails(degrees: float) -> None:
    """One turn from a scan to the next; in the one after it, the prediction turns as much again."""
    odometry, truth = Odometry(settings()), [np.eye(4)]
    for i in range(13):
        truth.append(truth[-1] @ se3.exp(np.array([0, 0, np.deg2rad(degrees) if i == 9 else 0, SPEED, 0, 0])))
    found = drive_with(odometry, np.array(truth))
    right = [
        error(step, T) < 0.05 and se3.angle(se3.inverse(T) @ step.pose) < 0.01
        for step, T in zip(found, truth, strict=True)
    ]
    assert all(ok or step.status == "failed" for ok, step in zip(right, found, strict=True))
    assert [step.status for step in found].count("failed") <= 1
    assert right[-1]


def test_a_small_abrupt_turn_needs_no_search() -> None:
    odometry, truth = Odometry(settings()), [np.eye(4)]
    for i in range(11):
        truth.append(truth[-1] @ se3.exp(np.array([0, 0, np.deg2rad(3.0) if i == 9 else 0, SPEED, 0, 0])))
    assert {step.status for step in drive_with(odometry, np.array(truth))} == {"registered"}


def test_a_new_scene_is_tracked_after_the_map_is_restarted() -> None:
    """Moved to another place: the map is restarted there, at the predicted pose, and tracking continues."""
    odometry = Odometry(settings())
    drive_with(odometry, drive(6))
    elsewhere = se3.exp(np.array([0, 0, 1.0, 70, 0, 0]))
    path = [elsewhere @ T for T in drive(14, speed=0.5)]
    found = [odometry.register(scan(T, 100 + i), 0.6 + 0.1 * i) for i, T in enumerate(path)]
    assert all(step.status != "failed" for step in found[-4:])
    moved = se3.inverse(found[-4].pose) @ found[-1].pose
    true = se3.inverse(path[-4]) @ path[-1]
    assert np.linalg.norm(moved[:3, 3] - true[:3, 3]) < 0.1


@pytest.mark.parametrize(
    ("values", "metres"),
    [
        ({"registration": "icp-point-to-plane", "target": "scan"}, 0.5),
        ({"target": "scan", "cell_sizes": (4.0, 2.0, 1.0), "neighbours": 7, "voxel_size": 0.5}, 0.5),
        ({"neighbours": 7}, 0.1),
        ({"cell_sizes": (1.0,)}, 0.1),
    ],
)
def test_other_settings_track_the_street(values: dict[str, object], metres: float) -> None:
    truth = drive(10, speed=0.7)
    found = drive_with(Odometry(settings(**values)), truth)
    assert all(step.status != "failed" for step in found)
    assert error(found[-1], truth[-1]) < metres


@pytest.mark.parametrize("stamps", [lambda i: 0.0 * i, lambda i: -0.1 * i, lambda i: 0.1 * (i if i < 5 else i - 5)])
def test_stamps_that_do_not_rise_do_not_affect_poses(stamps: Callable[[int], float]) -> None:
    truth, odometry = drive(10), Odometry(settings())
    found = [odometry.register(scan(T, i), stamps(i)) for i, T in enumerate(truth)]
    assert all(step.status != "failed" for step in found)
    assert all(np.isfinite(step.pose).all() for step in found)
    assert error(found[-1], truth[-1]) < 0.05


def test_the_cloud_is_deskewed_and_vertically_corrected() -> None:
    odometry = Odometry(settings(), vertical_correction=0.01)
    cloud = scan(np.eye(4), 0)
    step = odometry.register(cloud, 0.0)
    elevation = [np.arctan2(c.xyz[:, 2], np.hypot(c.xyz[:, 0], c.xyz[:, 1])) for c in (cloud, step.cloud)]
    np.testing.assert_allclose(elevation[1] - elevation[0], 0.01, atol=1e-4)


def distorted(still: PointCloud, motion_at: Callable[[float], Array]) -> PointCloud:
    """A scan as recorded while the sensor moves, with `motion_at(t)` from the middle of the sweep to t, -0.5 to 0.5."""
    time = np.arctan2(still.xyz[:, 1], still.xyz[:, 0]) / (2 * np.pi)
    slots = np.linspace(-0.5, 0.5, 41)
    slot = np.digitize(time, slots) - 1
    xyz = np.empty_like(still.xyz)
    for k, middle in enumerate((slots[1:] + slots[:-1]) / 2):
        back = se3.exp(-motion_at(middle))
        xyz[slot == k] = still.xyz[slot == k] @ back[:3, :3].T + back[:3, 3]
    return PointCloud(xyz, still.intensity, time=0.1 * time)


def test_scans_with_motion_distortion_are_deskewed() -> None:
    """Scans with motion distortion at 1.4 m per frame are tracked as accurately as undistorted ones."""
    truth, odometry = drive(12), Odometry(settings(), sweep_duration=0.1)
    motion = np.array([0, 0, HEADING, SPEED, 0, 0])
    found = registered(odometry, [distorted(scan(T, i), lambda t: t * motion) for i, T in enumerate(truth)])
    assert all(step.status != "failed" for step in found)
    moved, true = (se3.inverse(a) @ b for a, b in ((found[3].pose, found[-1].pose), (truth[3], truth[-1])))
    assert np.linalg.norm(moved[:3, 3] - true[:3, 3]) < 0.1


@pytest.mark.parametrize("degrees", [3.0, -6.0, 9.0])
def test_a_scan_that_turns_abruptly_is_deskewed_by_its_own_motion(degrees: float) -> None:
    """One sweep's turn, from mid-sweep to mid-sweep. Deskewed by the motion before, poses err by 0.1 to 0.4 m."""
    turns = np.full(13, HEADING)
    turns[9] = np.deg2rad(degrees)
    motions = np.array([[0, 0, turn, SPEED, 0, 0] for turn in turns])  # from scan i to the next
    truth = [np.eye(4)]
    for motion in motions[:-1]:
        truth.append(truth[-1] @ se3.exp(motion))
    clouds = [
        distorted(scan(T, i), lambda t, i=i: t * motions[max(i - 1, 0) if t < 0 else i]) for i, T in enumerate(truth)
    ]
    found = registered(Odometry(settings()), clouds)
    assert all(step.status != "failed" for step in found)
    assert max(error(step, T) for step, T in zip(found, truth, strict=True)) < 0.08


# ---- real sequences


def odometry_for(dataset: Dataset) -> Odometry:
    assert dataset.sensor is not None
    return Odometry(
        load_config(input="64").odometry,
        sweep_duration=float(np.median(np.diff(dataset.stamps))),
        vertical_correction=dataset.sensor.vertical_correction,
    )


@dataclass
class Tracked:
    """The steps of a sequence, without their clouds of a gigabyte in total, and the size of the map after each."""

    steps: list[OdometryStep]
    sizes: list[int]

    @property
    def poses(self) -> Array:
        return np.array([step.pose for step in self.steps])


def through(dataset: Dataset, frames: Iterable[int]) -> Tracked:
    odometry, tracked = odometry_for(dataset), Tracked([], [])
    for i in frames:
        frame = dataset[i]
        tracked.steps.append(replace(odometry.register(frame.cloud, frame.stamp), recorded=EMPTY))
        tracked.sizes.append(len(odometry.target))
    return tracked


@pytest.fixture(scope="module")
def whole(real_data: RealData) -> Callable[[str], Tracked]:
    """`whole("kitti_raw_0013")`: the full sequence, tracked once."""

    @cache
    def tracked(name: str) -> Tracked:
        dataset = open_dataset(real_data(name))
        return through(dataset, range(len(dataset)))

    return tracked


def path_length(poses: Array) -> float:
    return float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())


@pytest.mark.parametrize("every", [1, 2, 3])
@pytest.mark.parametrize("name", ["kitti_odometry_04", "kitti_raw_0013"])
def test_real_sequences_are_tracked_with_missing_frames(
    real_data: RealData, whole: Callable[[str], Tracked], name: str, every: int
) -> None:
    dataset = open_dataset(real_data(name))
    assert dataset.ground_truth is not None
    frames = range(0, len(dataset), every)
    found = whole(name) if every == 1 else through(dataset, frames)
    assert "failed" not in [step.status for step in found.steps]
    truth = dataset.ground_truth[list(frames)]
    assert path_length(found.poses) == pytest.approx(path_length(truth), rel=0.015)
    assert error(found.steps[-1], truth[-1]) < 0.015 * path_length(truth)


def test_tracking_continues_after_ten_missing_frames(real_data: RealData, whole: Callable[[str], Tracked]) -> None:
    dataset = open_dataset(real_data("kitti_raw_0013"))
    frames = [i for i in range(61) if not 25 <= i < 35]
    found = through(dataset, frames)
    assert "failed" not in [step.status for step in found.steps]
    distance = np.linalg.norm(found.poses[:, :3, 3] - whole("kitti_raw_0013").poses[frames, :3, 3], axis=1)
    assert distance.max() < 0.15  # after 12 m without a scan


def test_a_standing_car_does_not_move(real_data: RealData) -> None:
    dataset = open_dataset(real_data("kitti_raw_0013"))
    frame, odometry, rng = dataset[0], odometry_for(dataset), np.random.default_rng(0)
    sizes = []
    for i in range(100):
        shaken = frame.cloud.xyz + rng.normal(0, 0.02, frame.cloud.xyz.shape)
        step = odometry.register(frame.cloud.with_xyz(shaken), 0.1 * i)
        assert step.status == "registered"
        assert np.linalg.norm(step.pose[:3, 3]) < 0.02
        sizes.append(len(odometry.target))
    assert np.rad2deg(se3.angle(step.pose)) < 0.02
    assert sizes[-1] < 1.5 * sizes[0]  # a few more cells, from noise


def test_the_size_of_the_map_is_bounded(whole: Callable[[str], Tracked]) -> None:
    """It has the cells within 100 m only: at most 25,600 on this sequence of 173 m."""
    sizes = whole("kitti_raw_0013").sizes
    assert max(sizes) < 30_000
    assert sizes[-1] < 1.1 * max(sizes[60:90])  # constant size


@pytest.mark.parametrize("name", ["kitti_odometry_04", "kitti_raw_0013"])
def test_odometry_is_deterministic(real_data: RealData, name: str) -> None:
    dataset = open_dataset(real_data(name))
    first, second = (through(dataset, range(15)) for _ in range(2))
    np.testing.assert_array_equal(first.poses, second.poses)
    np.testing.assert_array_equal([s.covariance for s in first.steps], [s.covariance for s in second.steps])


def test_a_sequence_may_begin_in_a_sharp_corner() -> None:
    """Ten degrees and 1.5 m from the first frame to the second, both unknown."""
    simulation = Simulation(SimulationConfig(spacing=1.5, camera=False))
    frames = range(184, 190)
    odometry, poses = Odometry(OdometrySettings()), []
    for number in frames:
        scan = simulation.rig.frame(number).scan
        poses.append(odometry.register(PointCloud(scan.xyz, scan.reflectance), 0.1 * number).pose)
    assert np.rad2deg(simulation.drive.yaw[frames[1]] - simulation.drive.yaw[frames[0]]) > 9
    truth = se3.inverse(simulation.rig.poses[frames[0]]) @ simulation.rig.poses[frames]
    error = se3.inverse(truth) @ np.array(poses)
    assert np.linalg.norm(error[:, :3, 3], axis=1).max() < 0.1
    assert np.rad2deg(se3.angle(error)).max() < 0.3
