"""Point-to-plane ICP in a synthetic hall."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.registration.icp import IcpTarget

Sampler = Callable[..., Array]


def ones(xyz: Array) -> Array:
    return np.ones(len(xyz), np.float32)


def icp_of(xyz: Array) -> IcpTarget:
    target = IcpTarget(max_iterations=40)
    target.insert(xyz, ones(xyz), np.eye(4))
    return target


@pytest.mark.parametrize(
    "motion", [[0.02, -0.01, 0.04, 0.2, -0.15, 0.05], [0, 0, -0.05, -0.2, 0.2, 0], [0, 0, 0, 0.3, 0, 0.0]]
)
def test_icp_recovers_a_motion(hall: Sampler, motion: list[float]) -> None:
    truth = se3.exp(np.array(motion))
    xyz = hall(1, truth, density=4.0)
    found = icp_of(hall(0, density=20.0)).align(xyz, ones(xyz), np.eye(4))
    difference = se3.inverse(truth) @ found.pose
    assert np.linalg.norm(difference[:3, 3]) < 0.02
    assert np.rad2deg(se3.angle(difference)) < 0.1
    assert found.overlap > 0.95
    assert found.inlier_ratio > 0.8
    assert np.linalg.eigvalsh(found.covariance)[0] > 0
    assert np.linalg.eigvalsh(found.sandwich)[0] > 0


def test_identical_points_are_registered_exactly(hall: Sampler) -> None:
    cloud = hall(0, density=2.0)
    truth = se3.exp(np.array([0.005, -0.005, 0.01, 0.05, -0.03, 0.02]))
    back = se3.inverse(truth)
    xyz = (cloud @ back[:3, :3].T + back[:3, 3]).astype(np.float32)
    found = icp_of(cloud).align(xyz, ones(xyz), np.eye(4))
    np.testing.assert_allclose(found.pose, truth, atol=5e-3)
    assert found.converged


def test_insert_replaces_the_last_scan(hall: Sampler) -> None:
    target = icp_of(hall(0, density=2.0))
    other = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    pose = np.eye(4)
    pose[:3, 3] = 100, 0, 0
    target.insert(other, ones(other), pose)
    assert len(target) == 4
    assert target.scorer(other, ones(other), pose)(pose) == pytest.approx(1.0)
    assert target.scorer(other, ones(other), pose)(np.eye(4)) == 0
    target.evict(np.zeros(3), 1.0)
    assert len(target) == 4
    target.clear()
    assert len(target) == 0


def test_a_scan_without_overlap_keeps_the_initial_guess(hall: Sampler) -> None:
    guess = np.eye(4)
    guess[:3, 3] = 500, 0, 0
    xyz = hall(1, density=2.0)
    found = icp_of(hall(0, density=2.0)).align(xyz, ones(xyz), guess)
    np.testing.assert_allclose(found.pose, guess, atol=1e-9)
    assert found.overlap == found.inlier_ratio == 0


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_scan_of_few_points_can_be_inserted(count: int) -> None:
    assert len(icp_of(np.ones((count, 3), np.float32))) == count
