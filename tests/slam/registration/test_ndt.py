"""NDT in a synthetic hall and corridor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.data import se3
from slam.data.cloud import Array
from slam.registration.ndt import NdtTarget
from slam.registration.voxels import VoxelGaussians

Sampler = Callable[..., Array]

small_motions = st.tuples(*[st.floats(-0.05, 0.05)] * 3, *[st.floats(-0.4, 0.4)] * 3).map(np.array)


def ones(xyz: Array) -> Array:
    return np.ones(len(xyz), np.float32)


CELLS = (2.0, 1.0)  # m, coarse first


def ndt_of(xyz: Array, *, surfaces: bool = True, neighbours: int = 1) -> NdtTarget:
    target = NdtTarget(CELLS, surfaces=surfaces, neighbours=neighbours)
    target.insert(xyz, ones(xyz), np.eye(4))
    return target


@pytest.fixture(scope="module")
def in_hall(hall: Sampler) -> NdtTarget:
    return ndt_of(hall(0, density=30.0))


def assert_close(found: Array, truth: Array, metres: float = 0.02, degrees: float = 0.1) -> None:
    difference = se3.inverse(truth) @ found
    assert np.linalg.norm(difference[:3, 3]) < metres
    assert np.rad2deg(se3.angle(difference)) < degrees


@settings(deadline=None, max_examples=30)
@given(small_motions)
def test_ndt_recovers_a_motion(in_hall: NdtTarget, hall: Sampler, motion: Array) -> None:
    truth = se3.exp(motion)
    xyz = hall(1, truth)
    found = in_hall.align(xyz, ones(xyz), np.eye(4))
    assert_close(found.pose, truth)
    assert found.converged
    assert found.overlap > 0.75  # cells along edges, with two surfaces, have no information
    assert found.inlier_ratio > 0.8
    assert 0 < in_hall.score(xyz, ones(xyz), found.pose) <= 1


def test_seven_neighbours_recover_a_motion(hall: Sampler) -> None:
    truth = se3.exp(np.array([0.02, -0.01, 0.05, 0.4, -0.3, 0.1]))
    xyz = hall(1, truth)
    found = ndt_of(hall(0, density=30.0), neighbours=7).align(xyz, ones(xyz), np.eye(4))
    assert_close(found.pose, truth)


def test_seven_neighbours_include_the_cells_across_each_face() -> None:
    within = np.random.default_rng(0).uniform(0.2, 0.8, (20, 3)).astype(np.float32)
    cells = VoxelGaussians(1.0, 5, 1000, regularisation=0.003)
    cells.insert(within, ones(within), np.eye(4))
    steps = np.array([[0, 0, 0], *np.eye(3), *-np.eye(3), [1, 1, 0], [2, 0, 0]])
    met = {}
    for neighbours in (1, 7):
        met[neighbours] = []
        for step in steps:
            point = (step + 0.5).astype(np.float32)[None]
            met[neighbours].append(cells.normal_equations(point, ones(point), np.eye(4), neighbours, 1.0)[2][4])
    assert met == {1: [1, 0, 0, 0, 0, 0, 0, 0, 0], 7: [1, 1, 1, 1, 1, 1, 1, 0, 0]}


def street(seed: int) -> Array:
    """Ground, mostly, and two walls along x with niches, seen from the middle."""
    rng = np.random.default_rng(seed)
    ground = np.column_stack([rng.uniform(-15, 15, 6000), rng.uniform(-6, 6, 6000), np.full(6000, -1.5)])
    x = rng.uniform(-15, 15, 800)
    wall = np.column_stack([x, np.where(np.floor(x / 3) % 2, 6.0, 7.5), rng.uniform(-1.5, 2, 800)])
    xyz = np.concatenate([ground, wall, wall * [1, -1, 1]])
    return np.asarray(xyz + rng.normal(0, 0.01, xyz.shape), np.float32)


@pytest.mark.parametrize(("degrees", "fit"), [(0.0, True), (20.0, False), (-35.0, False)])
def test_upright_surfaces_do_not_fit_at_a_wrong_yaw_and_the_ground_does(degrees: float, fit: bool) -> None:
    target = NdtTarget(CELLS, surfaces=True, max_iterations=1)
    target.insert(street(0), ones(street(0)), np.eye(4))
    turned = se3.exp(np.array([0, 0, np.deg2rad(degrees), 0, 0, 0]))
    found = target.align(street(1), ones(street(1)), turned, np.eye(6)[2:])  # no step in yaw nor in position
    assert found.inlier_ratio > 0.8
    assert (found.upright_inlier_ratio > 0.9) == fit
    assert (found.upright_inlier_ratio < 0.6) != fit


def test_score_is_maximal_at_the_true_pose(in_hall: NdtTarget, hall: Sampler) -> None:
    xyz = hall(2)
    scores = [in_hall.score(xyz, ones(xyz), se3.exp(np.array([0, 0, 0, d, 0, 0]))) for d in (0, 0.3, 0.6, -0.3, -0.6)]
    assert int(np.argmax(scores)) == 0


@settings(deadline=None, max_examples=20)
@given(small_motions, st.integers(0, 1000), st.sampled_from([1, 7]))
def test_gradient_is_the_derivative_of_the_cost(motion: Array, seed: int, neighbours: int) -> None:
    """With a huge kernel all robust weights are 1 and the cost, half the sum of w m, is quadratic in the residual."""
    rng = np.random.default_rng(seed)
    cells = VoxelGaussians(2.0, 5, 1000, regularisation=0.003)
    cloud = rng.uniform(-6, 6, (4000, 3)).astype(np.float32)
    cells.insert(cloud, ones(cloud), np.eye(4))
    pose = se3.exp(motion)
    xyz = rng.uniform(-5, 5, (200, 3)).astype(np.float32)
    weight = rng.uniform(0.2, 1, 200).astype(np.float32)
    inside = (np.abs((xyz @ pose[:3, :3].T + pose[:3, 3]) % 2.0 - 1.0) < 0.99).all(axis=1)  # no point leaves its cell
    xyz, weight = xyz[inside], weight[inside]

    def cost(step: Array) -> float:
        moved = se3.exp(np.concatenate([step[:3], np.zeros(3)])) @ pose
        moved[:3, 3] = pose[:3, 3] + step[3:]
        return 0.5 * cells.normal_equations(xyz, weight, moved, neighbours, 1e9)[2][1]

    H, gradient, _ = cells.normal_equations(xyz, weight, pose, neighbours, 1e9)
    numeric = np.array([(cost(1e-5 * e) - cost(-1e-5 * e)) / 2e-5 for e in np.eye(6)])
    np.testing.assert_allclose(gradient, numeric, rtol=1e-4, atol=1e-4 * float(np.abs(gradient).max()))
    # in the three translations the cost is quadratic: its second derivative is H
    second = [(cost(1e-3 * e) - 2 * cost(0 * e) + cost(-1e-3 * e)) / 1e-6 for e in np.eye(6)[3:]]
    np.testing.assert_allclose(np.diag(H)[3:], second, rtol=1e-4)
    np.testing.assert_allclose(H, H.T, rtol=1e-9)


def test_covariance_is_symmetric_and_positive_definite(in_hall: NdtTarget, hall: Sampler) -> None:
    xyz = hall(3, se3.exp(np.array([0, 0, 0.05, 0.3, 0.1, 0])))
    found = in_hall.align(xyz, ones(xyz), np.eye(4))
    np.testing.assert_allclose(found.covariance, found.covariance.T, rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(found.sandwich, found.sandwich.T, rtol=1e-6, atol=1e-15)
    assert np.linalg.eigvalsh(found.covariance)[0] > 0
    assert np.linalg.eigvalsh(found.sandwich)[0] > 0
    assert np.linalg.eigvalsh(found.H)[0] > 0
    assert np.sqrt(np.diag(found.covariance)[3:]).max() < 0.02


@pytest.mark.parametrize(("heading", "axis"), [(0, 0), (90, 1), (180, 0)])
def test_covariance_grows_along_a_corridor(corridor: Sampler, heading: float, axis: int) -> None:
    """In the sensor's axes: after a rotation by 90 degrees, the y axis lies along the corridor."""
    pose = se3.exp(np.array([0, 0, np.deg2rad(heading), 0, 0, 0]))
    xyz = corridor(1, pose)
    found = ndt_of(corridor(0)).align(xyz, ones(xyz), pose)
    for covariance in (found.covariance, found.sandwich):
        spread, directions = np.linalg.eigh(covariance[3:, 3:])
        assert abs(directions[axis, 2]) > 0.99
        assert spread[2] > 20 * spread[1]
    across = se3.inverse(pose) @ found.pose
    assert np.abs(np.delete(across[:3, 3], axis)).max() < 0.02
    assert np.rad2deg(se3.angle(across)) < 0.1


def test_duplicated_points_do_not_reduce_the_covariance(in_hall: NdtTarget, hall: Sampler) -> None:
    """Adjacent points, as interpolation makes them, share an error."""
    xyz = hall(3, np.eye(4))
    once, often = (in_hall.align(points, ones(points), np.eye(4)) for points in (xyz, np.tile(xyz, (4, 1))))
    np.testing.assert_allclose(often.covariance, once.covariance / 4, rtol=1e-3)
    np.testing.assert_allclose(often.sandwich, once.sandwich, rtol=1e-3, atol=1e-12)


def test_the_sandwich_covariance_matches_the_errors(hall: Sampler) -> None:
    """Many scans with independent noise against one map; the ratio is one of standard deviations."""
    found = [ndt_of(hall(0, density=30.0)).align(xyz, ones(xyz), np.eye(4)) for xyz in map(hall, range(1, 25))]
    errors = np.array([se3.log(result.pose) for result in found])
    expected = np.mean([np.diag(result.sandwich) for result in found], axis=0)
    assert (np.abs(np.log(np.sqrt((errors**2).mean(axis=0) / expected))) < np.log(3)).all()


def test_covariance_is_in_the_axes_of_the_source(in_hall: NdtTarget, hall: Sampler) -> None:
    xyz, turn = hall(4), se3.exp(np.array([0.3, -0.2, 1.2, 0, 0, 0]))
    straight = in_hall.align(xyz, ones(xyz), np.eye(4))
    turned_xyz = (xyz @ turn[:3, :3]).astype(np.float32)
    turned = in_hall.align(turned_xyz, ones(xyz), turn)
    R = np.kron(np.eye(2), turn[:3, :3])
    np.testing.assert_allclose(R @ turned.covariance @ R.T, straight.covariance, atol=2e-2 * straight.covariance.max())
    np.testing.assert_allclose(R @ turned.H @ R.T, straight.H, atol=2e-2 * straight.H.max())


def test_registration_is_deterministic(hall: Sampler) -> None:
    xyz = hall(5, se3.exp(np.array([0.01, 0.02, 0.03, 0.3, -0.2, 0.1])))
    first, second = (ndt_of(hall(0)).align(xyz, ones(xyz), np.eye(4)) for _ in range(2))
    for name in ("pose", "H", "covariance", "inlier_ratio", "overlap", "converged"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)


def test_a_scan_without_overlap_keeps_the_initial_guess(in_hall: NdtTarget, hall: Sampler) -> None:
    guess = np.eye(4)
    guess[:3, 3] = 500, 0, 0
    xyz = hall(6)
    found = in_hall.align(xyz, ones(xyz), guess)
    np.testing.assert_allclose(found.pose, guess, atol=1e-9)
    assert found.overlap == in_hall.score(xyz, ones(xyz), guess) == 0


def test_ndt_registers_far_from_the_origin(hall: Sampler) -> None:
    far = np.eye(4)
    far[:3, 3] = 10_000, -10_000, 0
    target = NdtTarget(CELLS, surfaces=True)
    cloud = hall(0, density=30.0)
    target.insert(cloud, ones(cloud), far)
    motion = se3.exp(np.array([0.01, 0.02, 0.04, 0.3, -0.2, 0.1]))
    xyz = hall(1, motion)
    assert_close(target.align(xyz, ones(xyz), far).pose, far @ motion)


def test_clear_and_evict_apply_to_all_levels(hall: Sampler) -> None:
    target = ndt_of(hall(0))
    count = len(target)
    target.evict(np.zeros(3), 5.0)
    assert 0 < len(target) < count
    assert target.score(np.full((5, 3), 8.0, np.float32), np.ones(5, np.float32), np.eye(4)) == 0
    target.clear()
    assert len(target) == 0
    xyz = hall(1)
    assert target.score(xyz, ones(xyz), np.eye(4)) == 0
