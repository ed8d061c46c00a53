"""Scans with too many points."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import scan_size
from slam.data.cloud import Frame, PointCloud
from slam.slam import Slam


def frame(count: int, number: int = 0) -> Frame:
    return Frame(number, 0.1 * number, PointCloud(np.arange(3.0 * count).reshape(-1, 3), np.zeros(count)))


@pytest.mark.parametrize(("count", "kept"), [(9, 9), (10, 10), (11, 6), (20, 10), (100, 10), (101, 10)])
def test_points_are_chosen_evenly(count: int, kept: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scan_size, "MAX_POINTS", 10)
    cloud = scan_size.thinned(frame(count)).cloud
    assert len(cloud) == kept
    assert len(scan_size.size_problem(frame(count))) == (count > 10)
    assert len(set(np.diff(cloud.xyz[:, 0]))) == 1


def test_a_scan_of_three_million_random_points_fails_and_the_run_goes_on(street_scans: list[np.ndarray]) -> None:
    points = np.random.default_rng(0).normal(0, 20, (3_000_000, 3)).astype(np.float32)
    with Slam() as slam:
        for number, scan in enumerate(street_scans[:5]):
            xyz = points if number == 3 else np.ascontiguousarray(scan[:, :3])
            slam.add(Frame(number, 0.1 * number, PointCloud(xyz, np.zeros(len(xyz)))))
        run = slam.finish()
    assert [record.status for record in run.records] == ["registered"] * 3 + ["failed", "registered"]
    assert [problem.kind for problem in run.problems] == ["too many points"]
    assert run.records[3].points == 1_000_000
