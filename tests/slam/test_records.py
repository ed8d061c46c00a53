"""Records of frames keep all bits."""

from __future__ import annotations

import numpy as np

from slam.records import STAGES, FrameRecord, Records


def record(index: int, status: str = "registered", unobserved: int = 0) -> FrameRecord:
    draw = np.random.default_rng(index)
    laps = dict(zip(STAGES, draw.random(4).tolist(), strict=True))
    pose, covariance = draw.random((4, 4)), draw.random((6, 6))
    return FrameRecord(index, 0.1 * index, pose, covariance, status, np.nan, 7, laps, draw.random((unobserved, 6)))


def same(one: FrameRecord, other: FrameRecord) -> None:
    for name, value in vars(one).items():
        np.testing.assert_equal(getattr(other, name), value)


def test_records_come_back_as_they_were_appended() -> None:
    given = [record(3), record(5, "degenerate", 2), record(7, "failed")]
    kept = Records(given)
    assert len(kept) == 3
    for one, other in zip(given, kept, strict=True):
        same(one, other)
    same(given[-1], kept[-1])
    same(given[1], kept[1:][0])
    assert kept.indices.tolist() == [3, 5, 7]
    assert kept.statuses == ["registered", "degenerate", "failed"]
    assert [len(directions) for directions in kept.unobserved] == [0, 2, 0]
    np.testing.assert_array_equal(kept.poses, [each.pose for each in given])
    np.testing.assert_array_equal(kept.covariances, [each.covariance for each in given])
    np.testing.assert_array_equal(kept.milliseconds("waiting"), [each.milliseconds["waiting"] for each in given])


def test_a_record_is_replaced_with_its_unobservable_directions() -> None:
    kept = Records([record(0), record(1, "degenerate", 1)])
    kept[-1] = record(2)
    same(kept[1], record(2))
