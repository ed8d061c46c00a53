from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slam.data.beams import nearest_rings, recover_rings, rings_in_file_order, turn_times
from slam.data.problem import spans
from slam.data.sensor import load_sensor

HDL64, SCAN = load_sensor("hdl64"), Path("000000.bin")


def test_a_ring_starts_where_the_azimuth_wraps() -> None:
    # Two rings, counter-clockwise from +x: front, left, rear, right.
    turn = np.array([[1, 0.1, 0], [0, 1, 0], [-1, 0, 0], [0.1, -1, 0]], np.float32)
    ring, count = recover_rings(np.concatenate([turn, turn]))
    assert ring.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
    assert count == 2


def test_no_points_have_no_rings() -> None:
    ring, count = recover_rings(np.zeros((0, 3), np.float32))
    assert len(ring) == count == 0
    assert rings_in_file_order(np.zeros((0, 3), np.float32), HDL64, SCAN)[1] == ()


def test_a_sound_scan_has_64_rings_and_no_problem(hdl64_scan: Callable) -> None:
    ring, problems = rings_in_file_order(hdl64_scan()[:, :3].copy(), HDL64, SCAN)
    assert problems == ()
    assert ring.tolist() == np.repeat(np.arange(64), 360).tolist()


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize(
    "rings",
    [range(39), range(20, 64), [*range(5), *range(8, 64)], range(0, 64, 4), range(53)],
    ids=["upper 39", "lower 44", "three missing", "every fourth", "53"],
)
def test_missing_rings_are_told_by_the_laser_lines(hdl64_scan: Callable, rings: list[int], compensated: bool) -> None:
    sensor = replace(HDL64, motion_compensated=compensated)
    ring, problems = rings_in_file_order(hdl64_scan(rings, 1800)[:, :3].copy(), sensor, SCAN)
    assert ring.tolist() == np.repeat(list(rings), 1800).tolist()
    assert [problem.kind for problem in problems] == ["ring count"]
    assert f"000000.bin: {len(rings)} rings" in problems[0].message


def test_two_rings_without_a_wraparound_between_them_are_split(hdl64_scan: Callable) -> None:
    scan, true = hdl64_scan(columns=1800)[:, :3].copy(), np.repeat(np.arange(64), 1800)
    azimuth = np.arctan2(scan[:, 1], scan[:, 0]) % (2 * np.pi)
    kept = ~((true == 30) & (azimuth > 2.5)) & ~((true == 31) & (azimuth < 2.4))
    assert recover_rings(scan[kept])[1] == 63
    ring, problems = rings_in_file_order(scan[kept], HDL64, SCAN)
    assert (ring == true[kept]).all()
    assert len(problems) == 1


def test_a_stray_point_after_the_last_ring_makes_no_65th(hdl64_scan: Callable) -> None:
    scan = hdl64_scan()[:, :3]
    ring, problems = rings_in_file_order(np.concatenate([scan, scan[-360:-359]]), HDL64, SCAN)
    assert ring.max() == 63
    assert len(problems) == 1


def test_points_of_another_sensor_get_no_rings() -> None:
    rng = np.random.default_rng(0)
    ring, problems = rings_in_file_order(rng.uniform(-20, 20, (5000, 3)).astype(np.float32), HDL64, SCAN)
    assert ring is None
    assert "name the right sensor" in problems[0].message


def test_nearest_rings_need_no_order(hdl64_scan: Callable) -> None:
    order = np.random.default_rng(0).permutation(64 * 360)
    ring = nearest_rings(hdl64_scan()[order, :3].copy(), HDL64)
    assert (ring == np.repeat(np.arange(64), 360)[order]).all()


def test_the_sweep_goes_from_the_rear_over_left_and_front_to_the_right() -> None:
    rear_left, left, front, right, rear_right = [-1, 0.001, 0], [0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, -0.001, 0]
    points = np.array([rear_left, left, front, right, rear_right], np.float32)
    assert turn_times(points, 0.1) == pytest.approx([-0.05, -0.025, 0, 0.025, 0.05], abs=1e-4)
    assert turn_times(points, 0.2, "start") == pytest.approx([0, 0.05, 0.1, 0.15, 0.2], abs=1e-4)
    assert turn_times(points, 0.1, "end") == pytest.approx([-0.1, -0.075, -0.05, -0.025, 0], abs=1e-4)


def test_spans_are_short() -> None:
    assert spans([(3, 5), (9, 9)]) == "3-5, 9"
    assert spans([(n, n) for n in range(50)]).endswith("and 42 more")
