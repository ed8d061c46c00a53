"""The distortion of a scan by changes of the velocity, in the covariance of its pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.odometry import Odometry, OdometryStep
from slam.registration.icp import IcpTarget
from slam.registration.ndt import NdtTarget
from slam.registration.result import RegistrationResult
from slam.settings import OdometrySettings
from slam.simulation.layouts import FolderLayout
from slam.simulation.simulation import Simulation, SimulationConfig

SWEEP, FRAMES = 0.1, 60


def room(seed: int) -> Array:
    """Points (N, 3) on the six faces of a room of 11.3 m x 7.5 m x 3.1 m, with a sensor inside."""
    rng = np.random.default_rng(seed)
    low, high = np.array([-5.6, -3.3, -1.7]), np.array([5.7, 4.2, 1.4])
    faces = []
    for axis in range(3):
        for side in (low, high):
            points = rng.uniform(low, high, (3000, 3))
            points[:, axis] = side[axis]
            faces.append(points)
    return np.concatenate(faces) + rng.normal(0, 0.02, (6 * 3000, 3))


def settled(target: NdtTarget | IcpTarget, xyz: Array, weight: Array) -> RegistrationResult:
    """Registered again and again, for one registration stops where a step is below its thresholds."""
    found = target.align(xyz, weight, np.eye(4))
    for _ in range(10):
        found = target.align(xyz, weight, found.pose)
    return found


@pytest.mark.parametrize("target", [NdtTarget((1.0,), surfaces=True), IcpTarget(30)], ids=["ndt", "icp"])
def test_the_pose_follows_a_velocity_error(target: NdtTarget | IcpTarget) -> None:
    reference, xyz = room(0), room(1)
    target.clear()
    target.insert(reference.astype(np.float32), np.ones(len(reference), np.float32), np.eye(4))
    weight = np.ones(len(xyz), np.float32)
    time = (np.arctan2(xyz[:, 1], xyz[:, 0]) / (2 * np.pi) * SWEEP).astype(np.float32)
    error = np.array([0.05, -0.2, 0.1, 0.2, -0.1, 0.2])
    displaced = xyz + (np.cross(error[:3], xyz) + error[3:]) * time[:, None]
    sound, distorted = (settled(target, points.astype(np.float32), weight) for points in (xyz, displaced))
    moved = se3.log(se3.inverse(sound.pose) @ distorted.pose)
    predicted = target.distortion_response(xyz.astype(np.float32), weight, time, sound) @ error
    for part in (slice(0, 3), slice(3, 6)):
        assert np.linalg.norm((moved - predicted)[part]) < 0.6 * np.linalg.norm(moved[part])


def test_covariances_on_foot_are_consistent(tmp_path: Path) -> None:
    """A walker's rotations change within a sweep; without the distortion the NEES in pitch and z is 40 and more."""
    simulation = Simulation(SimulationConfig(drive="building", sensor="vlp16", distort=True, camera=False))
    layout = FolderLayout(tmp_path, SWEEP, "middle")
    for number in range(FRAMES):
        layout.write(simulation.rig.frame(number), number)
    odometry, steps = Odometry(OdometrySettings(), sweep_duration=SWEEP), list[OdometryStep]()
    for number, frame in enumerate(open_dataset(tmp_path, stamp="middle")):
        step = odometry.register(frame.cloud, SWEEP * number)
        steps[len(steps) - len(step.revised) :] = [*step.revised, step]
    motions, truths = (
        se3.inverse(poses[:-1]) @ poses[1:]
        for poses in (np.array([step.pose for step in steps]), simulation.rig.poses[:FRAMES])
    )
    errors = np.array([se3.log(se3.inverse(found) @ true) for found, true in zip(motions, truths, strict=True)])
    variances = np.array([np.diag(step.covariance) for step in steps[1:]])
    nees = np.mean((errors**2 / variances)[10:], axis=0)
    assert (nees > 0.1).all(), nees
    assert (nees < 10).all(), nees
