"""Which errors of an odometry accumulate: those of a registration against a local map do not."""

from __future__ import annotations

import numpy as np
import pytest

from eval.consistency import nees
from slam.data import se3
from slam.data.cloud import Array
from slam.graph.drift import YOUNG, MotionErrors, accumulating, map_errors
from slam.graph.pose_graph import Edge, PoseGraph
from slam.graph.uncertainty import drift_scale, frame_covariances
from slam.segments import GAP_COVARIANCE

X = 3  # index of x in (rotation, translation)
OBSERVED = np.zeros((0, 6))
NO_KEYFRAMES = (np.zeros(0, int), PoseGraph(np.zeros((0, 4, 4)), ()))


def _straight(count: int, step: float = 1.0) -> Array:
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = step * np.arange(count)
    return poses


def _errors(count: int, *, step: float = 1.0, failed: tuple[int, ...] = (), lost: Array = OBSERVED) -> MotionErrors:
    """Motions with a variance of 0.02 m² along x; in failed scans of 4 m²."""
    covariances = np.tile(np.diag([1e-10] * 3 + [0.02, 1e-8, 1e-8]), (count, 1, 1))
    covariances[list(failed), X, X] = 4.0
    which = np.isin(np.arange(count), failed)
    return map_errors(_straight(count, step), covariances, [lost] * count, which)


def _variances_along_x(count: int, errors: MotionErrors, step: float = 1.0) -> Array:
    return frame_covariances(_straight(count, step), errors, *NO_KEYFRAMES)[:, X, X]


def test_errors_of_registrations_do_not_accumulate_but_the_drift_of_the_map_does() -> None:
    """After 10 m: 0.01 m² at each end, and as much for each metre; ten independent motions would have 0.2 m²."""
    variances = _variances_along_x(11, _errors(11))
    assert variances[0] == 0
    assert variances[[1, 10]] == pytest.approx([0.03, 0.12])
    assert _variances_along_x(11, accumulating(np.tile(0.02 * np.eye(6), (11, 1, 1))))[10] == pytest.approx(0.2)


def test_a_standing_sensor_does_not_drift() -> None:
    assert _variances_along_x(1001, _errors(1001, step=0.0), step=0.0)[1000] == pytest.approx(0.02, abs=0.011)


def test_along_an_unobservable_direction_everything_accumulates() -> None:
    lost = np.array([[0, 0, 0, 1.0, 0, 0]])
    assert _variances_along_x(11, _errors(11, lost=lost))[10] == pytest.approx(10 * 0.02)


def test_the_error_of_a_failed_scan_ends_with_it() -> None:
    variances = _variances_along_x(7, _errors(7, failed=(3,)))
    assert variances[3] == pytest.approx(4.03, abs=0.001)
    assert variances[4] < 0.06


def test_before_the_first_map_the_errors_of_failed_scans_accumulate() -> None:
    variances = _variances_along_x(6, _errors(6, failed=(0, 1, 2)))
    assert variances[2] == pytest.approx(8.0)
    assert variances[5] > 8.0


def test_loops_do_not_correct_the_tilt_of_a_young_map() -> None:
    count = int(YOUNG) + 6
    errors = _errors(count)
    poses, keyframes = _straight(count), np.array([0, count - 1])
    relative = se3.inverse(poses[0]) @ poses[-1]
    edges = [Edge(0, 1, relative, np.eye(6)), Edge(0, 1, relative, 1e-12 * np.eye(6))]
    tilts = [
        frame_covariances(poses, errors, keyframes, PoseGraph(poses[keyframes], tuple(edges[:some])))[-1, 1, 1]
        for some in (1, 2)
    ]
    assert (errors.hidden[int(YOUNG) :] == 0).all()
    assert tilts[1] == pytest.approx(tilts[0], rel=0.05)
    assert tilts[0] > 100 * errors.own[-1, 1, 1]


@pytest.mark.parametrize("sigma", [1e-6, 1e-4])
def test_a_gap_beside_tight_motions_is_bridged_by_a_loop(sigma: float) -> None:
    """Edges of very different certainty: a new segment begins at frame 10, and a loop may join it."""
    poses, keyframes = _straight(20), np.array([0, 5, 10, 15])
    covariances = np.tile(sigma**2 * np.eye(6), (20, 1, 1))
    errors = map_errors(poses, covariances, [OBSERVED] * 20, np.zeros(20, bool), [10])
    errors.drift[10] = GAP_COVARIANCE
    between = [se3.inverse(poses[a]) @ poses[b] for a, b in ((0, 5), (5, 10), (10, 15), (0, 15))]
    edges = [Edge(k, k + 1, pose, np.eye(6)) for k, pose in enumerate(between[:3])]
    loop = Edge(0, 3, between[3], 1e-4 * np.eye(6))
    alone, joined = (
        np.sqrt(frame_covariances(poses, errors, keyframes, PoseGraph(poses[keyframes], tuple(some)))[:, X, X])
        for some in (edges, [*edges, loop])
    )
    assert alone[9] < 0.02 < 1.0 < alone[10]
    assert joined[12] == pytest.approx(0.01, rel=0.2)


def test_covariances_are_consistent_with_drawn_anticorrelated_motions() -> None:
    """Errors of successive motions have a correlation of -0.33: 0.1 m of each pose, and the same drift per metre."""
    rng, count = np.random.default_rng(4), 21
    drawn = rng.normal(0, 0.1, (500, count)) + rng.normal(0, 0.1, (500, count)).cumsum(axis=1)
    motions = np.diff(drawn, axis=1)
    assert np.corrcoef(motions[:, 5], motions[:, 6])[0, 1] == pytest.approx(-1 / 3, abs=0.1)
    errors = (drawn[:, -1] - drawn[:, 0])[:, None]
    stated = _variances_along_x(count, _errors(count))[-1]
    assert nees(errors, np.full((500, 1, 1), stated)) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("off", "factor"), [(0.1, 1.0), (2.0, 4 / 0.1 / 6)])
def test_drift_grows_to_what_the_loops_show(off: float, factor: float) -> None:
    """Ten motions of 1 m with 0.01 m² each, and a loop that is some distance off."""
    odometry = [Edge(k, k + 1, _straight(2)[1], np.diag([1e-8] * 3 + [0.01] * 3)) for k in range(10)]
    closed = _straight(2, 10.0 + off)[1]
    loops = [Edge(0, 10, closed, 1e-8 * np.eye(6)), Edge(10, 0, se3.inverse(closed), 1e-8 * np.eye(6))]
    assert drift_scale(odometry, loops) == pytest.approx(factor, rel=0.01)
    assert drift_scale(odometry, []) == 1.0
