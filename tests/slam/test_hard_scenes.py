"""Hard scenes for the whole run: a sensor that is carried elsewhere, covered, or whose scans are missing."""

from __future__ import annotations

import numpy as np
import pytest

from slam.config import load_config
from slam.data.cloud import Array, Frame, PointCloud
from slam.run import Run
from slam.slam import Slam

LENGTH, RANGE = 220.0, 40.0  # m


@pytest.fixture(scope="module")
def street() -> Array:
    """Points (N, 3) of a street with boxes of all sizes on both sides."""
    rng = np.random.default_rng(5)
    number = 300
    centres = np.column_stack(
        [rng.uniform(-30, LENGTH, number), rng.choice([-1, 1], number) * rng.uniform(5, 20, number)]
    )
    spread = rng.uniform(0.3, 2.5, (number, 1, 2))
    boxes = centres[:, None] + rng.uniform(-1, 1, (number, 80, 2)) * spread
    heights = rng.uniform(-1.7, 3, (number, 80, 1)) * rng.uniform(0.3, 1, (number, 1, 1))
    ground = np.column_stack([rng.uniform(-40, LENGTH, 20_000), rng.uniform(-25, 25, 20_000), np.full(20_000, -1.7)])
    return np.concatenate([np.concatenate([boxes, heights], axis=2).reshape(-1, 3), ground])


def run(street: Array, places: list[tuple[float, float]], covered: range = range(0)) -> Run:
    """The run over scans at (stamp, metre); those at the positions `covered` are empty."""
    rng = np.random.default_rng(6)
    with Slam(load_config(None, ["loops.enabled=false"])) as slam:
        for number, (stamp, metre) in enumerate(places):
            points = street - [metre, 0, 0]
            points = points[(np.abs(points[:, 0]) < RANGE) & (number not in covered)]
            points = points + rng.normal(0, 0.02, points.shape)
            slam.add(Frame(number, stamp, PointCloud(points, np.zeros(len(points)))))
        return slam.finish()


def test_a_jump_of_50_m_is_detected(street: Array) -> None:
    places = [*range(25), *range(75, 100)]
    result = run(street, [(0.1 * number, float(metre)) for number, metre in enumerate(places)])
    statuses = [record.status for record in result.records]
    assert "failed" not in statuses[:25]
    assert statuses[25:30] == ["failed"] * 5
    assert "failed" not in statuses[30:]
    assert "began new segments at frames 30" in result.notes()[0]
    within = result.poses[-1, 0, 3] - result.poses[32, 0, 3]
    assert within == pytest.approx(places[-1] - places[32], abs=0.5)


def test_a_lidar_that_was_covered_for_5_s_goes_on(street: Array) -> None:
    places = [(0.1 * number, 0.5 * number) for number in range(100)]
    result = run(street, places, range(25, 75))
    statuses = [record.status for record in result.records]
    assert statuses[25:75] == ["failed"] * 50
    assert "failed" not in statuses[78:]
    error = abs(result.poses[-1, 0, 3] - places[-1][1])
    assert error < 0.5 or any("began new segments" in note for note in result.notes())


def test_60_missing_scans_are_bridged_or_said(street: Array) -> None:
    numbers = [*range(25), *range(85, 115)]
    result = run(street, [(0.1 * number, 0.5 * number) for number in numbers])
    error = abs(result.poses[-1, 0, 3] - 0.5 * numbers[-1])
    assert error < 0.5 or any("began new segments" in note for note in result.notes())
    assert result.counts()["stamp_jump"] == 1
