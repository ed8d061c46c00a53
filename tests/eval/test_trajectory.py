"""ATE and RPE on inputs computed by hand, and their invariances."""

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from eval.alignment import alignment_transform, associate, nearest_rotation, umeyama
from eval.trajectory import ate, paper_table_iii, path_length, rpe_rotation, rpe_translation
from slam.data import se3


def poses_at(*positions):
    """Poses without rotation at the given positions."""
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, 3] = positions
    return poses


def winding(count=30):
    """A trajectory that turns and climbs, so that every rotation has an effect."""
    step = se3.exp(np.array([0.02, -0.01, 0.1, 1.0, 0.1, 0.05]))
    poses = [np.eye(4)]
    for _ in range(count - 1):
        poses.append(poses[-1] @ step)
    return np.array(poses)


tangents = arrays(float, 6, elements=st.floats(-3, 3)).map(lambda xi: xi * [0.5, 0.5, 0.5, 50, 50, 50])


def test_ate_of_a_small_example():
    reference = poses_at((0, 0, 0), (1, 0, 0), (2, 0, 0))
    estimate = poses_at((0, 0, 0), (1, 3, 0), (2, 0, 4))
    statistics = ate(estimate, reference, "unaligned")
    assert asdict(statistics) == pytest.approx(
        {"rmse": np.sqrt(25 / 3), "mean": 7 / 3, "median": 3, "std": np.sqrt(26) / 3, "min": 0, "max": 4, "sse": 25}
    )


def test_origin_alignment_aligns_the_first_poses():
    reference = poses_at((5, 5, 5), (6, 5, 5), (8, 5, 5))
    estimate = poses_at((0, 0, 0), (1, 0, 0), (2, 0, 0))
    assert ate(estimate, reference, "origin").sse == pytest.approx(1)


def test_alignment_has_no_scale():
    reference = poses_at((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0))
    double = reference.copy()
    double[:, :3, 3] *= 2
    # The corners of the aligned squares are half a diagonal of the smaller one apart.
    assert ate(double, reference).rmse == pytest.approx(np.sqrt(2))


@given(xi=tangents)
@settings(max_examples=50, deadline=None)
def test_a_rigidly_moved_estimate_has_no_aligned_error(xi):
    reference = winding()
    moved = se3.exp(xi) @ reference
    assert ate(moved, reference, "aligned").max < 1e-6
    assert ate(moved, reference, "origin").max < 1e-6


@given(xi=tangents)
@settings(max_examples=25, deadline=None)
def test_rpe_is_invariant_to_a_rigid_motion(xi):
    reference, estimate = winding(), winding() @ se3.exp(np.array([0.01, 0, 0.02, 0.1, 0.2, 0]))
    moved = se3.exp(xi) @ estimate
    for metric in (rpe_translation, rpe_rotation, paper_table_iii):
        expected = asdict(metric(estimate, reference))
        assert asdict(metric(moved, reference)) == pytest.approx(expected, rel=1e-6, abs=1e-5)


def test_rpe_of_a_small_example():
    reference = poses_at((0, 0, 0), (1, 0, 0), (2, 0, 0))
    estimate = poses_at((0, 0, 0), (1.1, 0, 0), (2.4, 0, 0))
    translation = rpe_translation(estimate, reference)
    assert (translation.min, translation.max, translation.mean) == pytest.approx((0.1, 0.3, 0.2))
    assert rpe_rotation(estimate, reference).max == pytest.approx(0)
    assert asdict(paper_table_iii(estimate, reference)) == pytest.approx(asdict(translation))


def test_rpe_of_the_rotation_is_in_degrees():
    reference = poses_at((0, 0, 0), (1, 0, 0), (2, 0, 0))
    estimate = reference.copy()
    estimate[1:, :3, :3] = se3.exp(np.array([0, 0, np.radians(2), 0, 0, 0]))[:3, :3]
    assert rpe_rotation(estimate, reference).max == pytest.approx(2)
    assert rpe_rotation(estimate, reference).min == pytest.approx(0, abs=1e-6)


def test_path_length_is_the_sum_of_steps():
    assert path_length(poses_at((0, 0, 0), (3, 4, 0), (3, 4, 2))) == pytest.approx(7)


@pytest.mark.parametrize("still", [poses_at(*[(7, 8, 9)] * 5), poses_at(*[(x, 0, 0) for x in range(5)])])
def test_alignment_of_degenerate_positions_uses_the_orientations(still):
    motion = se3.exp(np.array([0.3, -0.2, 0.5, 1, 2, 3]))
    T, unique = umeyama(motion @ still, still)
    assert not unique
    np.testing.assert_allclose(T, se3.inverse(motion), atol=1e-6)


def test_a_moving_estimate_of_a_standing_reference_keeps_its_error():
    standing, moving = poses_at(*[(0, 0, 0)] * 3), poses_at((-1, 0, 0), (0, 0, 0), (1, 0, 0))
    assert ate(moving, standing).sse == pytest.approx(2)


def test_alignment_transforms_of_each_kind():
    reference = winding()
    estimate = se3.exp(np.array([0, 0, 1, 5, 6, 7])) @ reference
    for alignment in ("aligned", "origin"):
        T, unique = alignment_transform(estimate, reference, alignment)
        assert unique
        np.testing.assert_allclose(T @ estimate, reference, atol=1e-9)
    np.testing.assert_array_equal(alignment_transform(estimate, reference, "unaligned")[0], np.eye(4))


@given(M=arrays(float, (3, 3), elements=st.floats(-10, 10)))
@settings(max_examples=50, deadline=None)
def test_nearest_rotation_is_a_rotation(M):
    R = nearest_rotation(M)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1)


def test_association_takes_the_nearest_stamp_within_ten_milliseconds():
    stamps, reference = np.array([0.0, 0.1, 0.2, 0.3]), np.array([0.091, 0.104, 0.211, 0.3])
    ours, theirs = associate(stamps, reference)
    assert (ours.tolist(), theirs.tolist()) == ([1, 3], [1, 3])
    theirs, ours = associate(np.append(reference, 9.0), stamps)
    assert 1 in ours
    assert 2 not in ours
