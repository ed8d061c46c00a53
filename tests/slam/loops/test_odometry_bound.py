"""Which places the odometry excludes."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.pose_graph import Edge
from slam.loops.odometry_bound import OdometryBound
from slam.segments import GAP_COVARIANCE

STEP = se3.exp(np.array([0, 0, 0, 2.0, 0, 0]))  # 2 m ahead


def edges(covariance: Array, count: int = 50) -> list[Edge]:
    return [Edge(k, k + 1, STEP, covariance) for k in range(count)]


def bound(odometry: list[Edge]) -> OdometryBound:
    result = OdometryBound()
    result.extend(odometry)
    return result


def covariance(rotation: float, translation: float) -> Array:
    """Standard deviations [rad, m] per axis."""
    return np.diag([rotation**2] * 3 + [translation**2] * 3)


def test_translations_add_up() -> None:
    # 25 motions of 0.1 m per axis
    assert bound(edges(covariance(1e-9, 0.1))).sigma(10, 35) == pytest.approx(np.sqrt(25 * 3 * 0.1**2), rel=1e-6)


def test_a_rotation_counts_by_its_distance_from_the_later_keyframe() -> None:
    odometry = edges(covariance(1e-9, 1e-9), 30)
    odometry[9] = Edge(9, 10, STEP, covariance(0.01, 1e-9))
    # the rotation is at keyframe 10: 40 m before keyframe 30, and none of its sigma is in what lies before or after
    assert bound(odometry).sigma(0, 30) == pytest.approx(np.sqrt(3) * 0.01 * 40, rel=1e-6)
    assert bound(odometry).sigma(10, 30) == pytest.approx(0, abs=1e-4)


def test_a_straight_drive_does_not_come_back() -> None:
    drift = covariance(np.deg2rad(0.2 * np.sqrt(2)), 0.05 * np.sqrt(2))  # the default drift over 2 m
    straight = bound(edges(drift, 100))
    assert straight.allows(0, 3, 8.0)
    assert not straight.allows(0, 60, 8.0)
    assert not straight.allows(40, 100, 8.0)


def test_a_round_comes_back_although_its_end_is_off() -> None:
    drift = covariance(np.deg2rad(0.2 * np.sqrt(2)), 0.05 * np.sqrt(2))
    step = STEP @ se3.exp(np.array([0, 0, np.deg2rad(3.5), 0, 0, 0]))  # 350 deg after 100 steps
    assert bound([Edge(k, k + 1, step, drift) for k in range(100)]).allows(0, 100, 8.0)


def test_a_gap_excludes_no_place_within_its_sigma() -> None:
    odometry = edges(covariance(1e-4, 0.01), 200)
    odometry[100] = Edge(100, 101, STEP, GAP_COVARIANCE)
    assert bound(odometry).allows(0, 200, 8.0)
    assert not bound(odometry).allows(0, 100, 8.0)


def test_edges_are_added_once() -> None:
    odometry, grown = edges(covariance(0.01, 0.1)), OdometryBound()
    for count in (0, 1, 20, 20, 50):
        grown.extend(odometry[:count])
    assert grown.sigma(3, 47) == bound(odometry).sigma(3, 47)  # the same sums of the same numbers
