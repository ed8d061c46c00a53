"""The devkit metric on trajectories whose drift can be computed by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from eval.kitti_metric import best_rotation, kitti_drift
from slam.data import se3


def straight(metres, step=1.0, scale=1.0):
    """A trajectory along x with a pose every `step` metres."""
    poses = np.tile(np.eye(4), (round(metres / step) + 1, 1, 1))
    poses[:, 0, 3] = scale * step * np.arange(len(poses))
    return poses


def town(metres):
    """A trajectory with bends to both sides and hills, a pose every metre."""
    poses = [np.eye(4)]
    for k in range(metres):
        poses.append(poses[-1] @ se3.exp(np.array([0, 0.01 * np.cos(k / 9), 0.05 * np.sin(k / 20), 1, 0, 0])))
    return np.array(poses)


def slow_reference(estimate, reference):
    """The definition word by word, segment after segment, with KITTI's lengths."""
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(reference[:, :3, 3], axis=0), axis=1))])
    errors = []
    for first in range(0, len(way), 10):
        for length in range(100, 900, 100):
            last = next((j for j in range(first, len(way)) if way[j] > way[first] + length), None)
            if last is None:
                continue
            e, g = (np.linalg.inv(poses[first]) @ poses[last] for poses in (estimate, reference))
            E = np.linalg.inv(e) @ g
            angle = np.arccos(np.clip((np.trace(E[:3, :3]) - 1) / 2, -1, 1))
            errors.append((np.linalg.norm(E[:3, 3]) / length, angle / length))
    translation, rotation = np.mean(errors, axis=0)
    return 100 * translation, 100 * np.degrees(rotation), len(errors)


def test_one_percent_of_scale_is_one_percent_of_drift():
    # A step a little over a metre: the first frame farther than 100 m is then 100.001 m away.
    reference, estimate = straight(850, 1.00001), straight(850, 1.00001, scale=1.01)
    drift = kitti_drift(estimate, reference)
    assert drift.translation_percent == pytest.approx(1.0, abs=5e-4)
    assert drift.rotation_deg_per_100m == pytest.approx(0, abs=1e-9)
    assert drift.name == "KITTI 100-800 m"
    assert drift.lengths_m == tuple(range(100, 900, 100))


def test_a_segment_ends_strictly_beyond_its_length():
    # 200 steps of exactly 1 m: segments of 100 m span 101 frames and are divided by 100, as in the devkit.
    drift = kitti_drift(straight(200, scale=1.01), straight(200))
    assert drift.translation_percent == pytest.approx(1.01)
    assert (drift.name, drift.lengths_m) == ("KITTI 100 m", (100.0,))
    assert drift.segments == 10  # starts 0, 10 .. 90; frame 200 is not beyond 100 + 100 m


def test_a_constant_turn_rate_is_rotation_drift():
    reference, estimate = straight(400, 1.00001), straight(400, 1.00001)
    for k, pose in enumerate(estimate):
        pose[:3, :3] = se3.exp(np.array([0, 0, np.radians(0.02 * k), 0, 0, 0]))[:3, :3]
    assert kitti_drift(estimate, reference).rotation_deg_per_100m == pytest.approx(2.0)


def test_drift_agrees_with_a_literal_implementation():
    reference = town(450)
    estimate = reference @ se3.exp(np.array([0.001, 0, 0.01, 0, 0, 0]))
    estimate[:, :3, 3] *= 1.003
    translation, rotation, segments = slow_reference(estimate, reference)
    drift = kitti_drift(estimate, reference)
    assert drift.translation_percent == pytest.approx(translation)
    assert drift.rotation_deg_per_100m == pytest.approx(rotation)
    assert drift.segments == segments


@pytest.mark.parametrize(
    ("metres", "name", "lengths"),
    [(199, "short drive, 50 m", (50.0,)), (61, "short drive, 50 m", (50.0,)), (20, "short drive, 10 m", (10.0,)),
     (350, "KITTI 100-300 m", (100.0, 200.0, 300.0))],
)  # fmt: skip
def test_short_sequences_are_named(metres, name, lengths):
    drift = kitti_drift(straight(metres, 0.5, scale=1.01), straight(metres, 0.5))
    assert (drift.name, drift.lengths_m) == (name, lengths)
    assert drift.segments > 0
    assert drift.reason is None


def test_a_path_too_short_for_any_segment_has_a_reason():
    drift = kitti_drift(straight(5), straight(5))
    assert drift.translation_percent is drift.rotation_deg_per_100m is drift.body_rotation_removed is None
    assert drift.segments == 0
    assert drift.reason == "the reference path of 5.0 m is shorter than 12 m"


def test_a_heading_offset_is_drift_and_is_removed_with_the_body_rotation():
    # The body frame turned by 1.4 deg moves the end of each segment by 2 sin(0.7 deg) of its length: 2.44 %.
    offset = se3.exp(np.array([0, 0, np.radians(1.4), 0, 0, 0]))
    reference = straight(173, 1.00001)
    drift = kitti_drift(reference @ offset, reference)
    assert drift.translation_percent == pytest.approx(200 * np.sin(np.radians(0.7)), rel=1e-4)
    assert drift.body_rotation_removed.translation_percent == pytest.approx(0, abs=1e-5)
    assert drift.body_rotation_removed.rotation_deg == pytest.approx(1.4, abs=1e-5)


@given(omega=arrays(float, 3, elements=st.floats(-1, 1)))
@settings(max_examples=25, deadline=None)
def test_constant_body_rotations_are_removed(omega):
    reference = town(260)
    drift = kitti_drift(reference @ se3.exp(np.concatenate([omega, np.zeros(3)])), reference)
    removed = drift.body_rotation_removed
    assert removed.translation_percent < 1e-4
    assert removed.rotation_deg_per_100m < 1e-4
    assert removed.rotation_deg == pytest.approx(np.degrees(np.linalg.norm(omega)), abs=1e-3)


def test_roll_is_not_removed_on_a_straight_path():
    noise = 0.002 * np.random.default_rng(0).normal(size=(2, 20, 3))
    forward = np.array([1.0, 0, 0])
    X = best_rotation(forward + noise[0], forward + noise[1])
    assert np.degrees(se3.angle(np.block([[X, np.zeros((3, 1))], [np.zeros((1, 3)), 1]]))) < 0.2


def test_drift_is_invariant_to_a_rigid_motion():
    reference = town(260)
    estimate = reference.copy()
    estimate[:, :3, 3] *= 1.01
    moved = se3.exp(np.array([0.1, 0.2, 0.3, 4, 5, 6])) @ estimate
    assert kitti_drift(moved, reference).translation_percent == pytest.approx(
        kitti_drift(estimate, reference).translation_percent
    )
