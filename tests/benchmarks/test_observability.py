"""Structure of scenes along the road, reports of the odometry, and the page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.page import surroundings
from benchmarks.common.simulated import course
from benchmarks.odometry import inputs
from benchmarks.odometry.measure import Run
from benchmarks.odometry.nees import nees, nees_by_axis, nees_over_keyframes
from benchmarks.odometry.observability import figures, named_angles, what_holds
from benchmarks.odometry.observability_page import ELSEWHERE, ENDS, NOTHING, REPEATS, page
from benchmarks.odometry.own_run import OwnRun, base_sizes, own_run, settings_of
from benchmarks.odometry.systems import our_odometry
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.graph.drift import map_errors

NONE, LOST = np.zeros((0, 6)), np.zeros(40, bool)


def straight(count: int, step: float = 1.0) -> Array:
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = step * np.arange(count)
    return poses


def said(poses: Array, statuses: list[str], unobserved: list[list[float]] | None = None) -> OwnRun:
    rows = np.array(unobserved).reshape(-1, 6) if unobserved else np.zeros((0, 6))
    named = [rows if status == "degenerate" else np.zeros((0, 6)) for status in statuses]
    return OwnRun(poses, np.tile(0.01 * np.eye(6), (len(poses), 1, 1)), np.array(statuses), named)


def test_structure_along_the_road_is_classified() -> None:
    tunnel, bridge = course("tunnel"), course("bridge")
    numbers = np.arange(len(tunnel))
    kinds, way = what_holds(tunnel, numbers, 80.0), tunnel.way
    assert ((kinds == NOTHING) == ((way >= 140) & (way <= 180))).all()
    assert ((kinds == ELSEWHERE) == ((way < 60) | (way > 260))).all()
    assert (what_holds(tunnel, numbers, 100.1) != NOTHING).all()  # the ends are always in reach
    assert (what_holds(bridge, np.arange(5), 80.0) == REPEATS).all()
    assert (what_holds(None, np.arange(5), 80.0) == ELSEWHERE).all()


def test_directions_that_are_named() -> None:
    along, aside, turn = [0, 0, 0, 1.0, 0.1, 0], [0, 0, 0, 0, 1.0, 0], [0, 0, 1.0, 0, 0, 0]
    axes, everywhere = np.tile([1.0, 0, 0], (1, 1)), np.array([True])
    for rows, degrees in (([aside, along], 5.7), ([aside], 90), ([turn], 90)):
        angles = np.rad2deg(named_angles(said(straight(1), ["degenerate"], rows), axes, everywhere))
        assert angles == pytest.approx([degrees], abs=0.1)
    assert len(named_angles(said(straight(1), ["registered"]), axes, everywhere)) == 0


def test_the_motion_from_a_failed_frame_has_its_error_too() -> None:
    run = said(straight(4), ["registered", "failed", "registered", "registered"])
    np.testing.assert_allclose(run.motion_covariances[:, 0, 0], [0.01, 0.01, 0.02, 0.01])


def test_figures_by_kind_of_frame() -> None:
    truth, poses = straight(12), straight(12)
    poses[6:, 0, 3] += 0.5  # frame 6 jumps ahead and is degenerate; frame 9 jumps unreported
    poses[9:, 0, 3] += 0.5
    statuses = ["registered"] * 12
    statuses[6] = statuses[7] = "degenerate"
    kinds = np.array([ELSEWHERE] * 5 + [NOTHING] * 4 + [REPEATS] * 3)
    found = figures(said(poses, statuses, [[0, 0, 0, 1.0, 0, 0]]), truth, kinds)
    nothing, repeats = found["kinds"][NOTHING], found["kinds"][REPEATS]
    assert (nothing["frames"], nothing["degenerate"], nothing["off"], nothing["off_untold"]) == (4, 0.5, 1, 0)
    assert (repeats["degenerate"], repeats["off"], repeats["off_untold"]) == (0.0, 1, 1)
    assert found["named"] == 2
    assert found["angle_deg"] == pytest.approx(0, abs=1e-5)
    assert found["near"] == 1
    assert found["along_track_m"] == pytest.approx(1.0)


def test_nees_of_each_axis() -> None:
    truth, poses = straight(9), straight(9)
    poses[:, 0, 3] *= 1.1  # 0.1 m too far a frame, as the covariance has it
    covariances = np.tile(0.01 * np.eye(6), (9, 1, 1))
    by_axis = nees_by_axis(poses, covariances, truth)
    assert by_axis == pytest.approx({"roll": 0, "pitch": 0, "yaw": 0, "x": 1, "y": 0, "z": 0}, abs=1e-9)
    assert nees(poses, covariances, truth) == pytest.approx(1 / 6)


def test_nees_over_keyframes() -> None:
    """A scale error of 1 %: 20 cm over ten keyframes of 2 m, for which registrations and drift allow some."""
    truth, poses = straight(40, 2.0), straight(40, 2.02)
    found = nees_over_keyframes(
        poses, map_errors(poses, np.tile(2e-4 * np.eye(6), (40, 1, 1)), [NONE] * 40, LOST), truth
    )
    assert set(found) == {"1", "10", "poses"}  # there are no 55 keyframes
    assert found["1"]["x"] == pytest.approx(0.02**2 / (2e-4 + 2.02e-4), rel=0.01)
    assert found["10"]["x"] == pytest.approx(0.2**2 / (2e-4 + 20.2e-4), rel=0.01)
    assert found["10"]["y"] == pytest.approx(0)


def test_the_page_says_what_was_met() -> None:
    axes = dict.fromkeys(("roll", "pitch", "yaw", "x", "y", "z"), 1.0)
    frames = {"frames": 10, "degenerate": 0.9, "lost": 0.0, "off": 4, "off_untold": 1}
    entry = {
        "reason": None, "frames": 20, "reach_m": 80.0, "named": 9, "angle_deg": 2.0, "near": 1.0, "nees": 1.0,
        "nees_by_axis": axes | {"x": 4.0}, "nees_over_keyframes": {"1": {"all": 0.2} | axes, "poses": {"all": 2.0}},
        "ate_m": 0.5, "along_track_m": None, "path_length_m": 9.0,
        "truth_path_length_m": 10.0, "kinds": {NOTHING: frames, ENDS: frames, ELSEWHERE: frames | {"degenerate": 0.0}},
    }  # fmt: skip
    bridge = entry | {"kinds": {REPEATS: frames}}
    found = {"tunnel": {"full": entry, "lift": {"reason": "no images"}}, "bridge": {"full": bridge}}
    told = page({"about": surroundings(()) | {"command": "none"}, **found})
    for line in (
        "| reported, no structure, tunnel, full [share] | 0.90 | >= 0.95 | missed |",
        "| reported if off, repeating structure, bridge, full [share] | 0.75 | >= 0.95 | missed |",
        "| reported elsewhere, maximum over sequences [share] | 0.000 | <= 0.01 | met |",
        "| NEES along an axis, maximum over sequences | 4.00 | <= 3.0 | missed |",
        "| tunnel | full | an end | 10 | 90.0 | 0.0 | 4 | 1 | - |",
        "| tunnel | full | 1.00 | 1.00 | 1.00 | 4.00 | 1.00 | 1.00 | 1.00 | missed: x |",
        "| tunnel | full | 0.20 | - | - | 2.00 | 1.00 to 1.00 | missed: 1 |",
        "| NEES of the poses, share within 0.3 to 3 | 1.00 | >= 1 | met |",
    ):
        assert line in told


def test_statuses_are_counted_of_those_who_say_them() -> None:
    assert Run(statuses=["registered", "degenerate", "degenerate"]).count("degenerate") == 2
    assert Run(statuses=[None, None]).count("degenerate") is None


def test_our_odometry_alone(street_drive: Callable[..., Path]) -> None:
    data = open_dataset(street_drive())
    run = own_run(data, (data[position] for position in range(4)), "full")
    assert (run.poses.shape, run.covariances.shape) == ((4, 4, 4), (4, 6, 6))
    assert run.share("registered", np.ones(4, bool)) == 1
    assert run.share("registered", np.zeros(4, bool)) is None


def test_sizes_are_those_that_the_odometry_takes(street_drive: Callable[..., Path]) -> None:
    data = open_dataset(street_drive())
    tracker = our_odometry(settings_of("16", data), data)
    tracker.register(inputs.front_end("16", data)(data[0], ()), 0.0)
    sizes = base_sizes("16", data, data[0])
    assert set(sizes) == {"cell_sizes", "voxel_size", "map_voxel_size"}
    for name, size in sizes.items():
        np.testing.assert_allclose(size, getattr(tracker.sizes, name), rtol=0.02, err_msg=name)  # before deskewing
