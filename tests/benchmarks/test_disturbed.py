"""Disturbances of small literal sequences, and a small run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.common.page import surroundings
from benchmarks.odometry import disturbed
from benchmarks.odometry.chosen_drives import ChosenDrive
from benchmarks.odometry.disturbances import Schedule, moving, scaled
from benchmarks.odometry.disturbed_page import page
from slam.config import load_config
from slam.data.dataset import open_dataset

FOUR = Schedule(np.arange(5, 9), np.array([1.0, 1.1, 1.2, 1.3]))


def test_a_clock_that_jumps_in_the_middle() -> None:
    assert FOUR.clock_set(37.0).stamps == pytest.approx([1.0, 1.1, 38.2, 38.3])
    assert FOUR.clock_set(37.0).positions.tolist() == [5, 6, 7, 8]


def test_frames_left_out() -> None:
    index = np.array([0, 2, 3])
    assert FOUR.chosen(index).positions.tolist() == [5, 7, 8]
    assert FOUR.chosen(index).stamps == pytest.approx([1.0, 1.2, 1.3])
    assert FOUR.chosen(index, closed_up=True).stamps == pytest.approx([1.0, 1.1, 1.2])


def test_stops_take_time() -> None:
    stopping, index = FOUR.stopping()
    assert len(index) == 4 + 3 * 29
    assert np.unique(stopping.positions, return_counts=True)[1].tolist() == [1, 30, 30, 30]
    assert np.diff(stopping.stamps) == pytest.approx(np.full(90, 0.1))
    assert (stopping.positions == index + 5).all()


def test_who_moves() -> None:
    truth = np.tile(np.eye(4), (6, 1, 1))
    truth[:, 0, 3] = 0.0, 0.006, 0.012, 0.012, 0.1, 0.105
    assert moving(truth).tolist() == [0, 2, 4]


def test_sizes_times_a_factor() -> None:
    overrides = scaled({"cell_sizes": (2.0, 1.0), "voxel_size": 1.5}, 0.75)
    assert overrides == ["odometry.cell_sizes=[1.5, 0.75]", "odometry.voxel_size=1.125"]
    assert load_config(overrides=overrides).odometry.cell_sizes == (1.5, 0.75)


def test_a_small_run(street_drive: Callable[..., Path]) -> None:
    pytest.importorskip("kiss_icp")
    data = open_dataset(street_drive())
    drive = ChosenDrive(disturbed.STOPPING, data, list(range(len(data))), simulated=True)
    case = disturbed.Case(drive, "full", drive.exact_truth)
    found: dict[str, Any] = {part: [] for part in disturbed.PARTS}
    for part, measure in disturbed.PARTS.items():
        found[part] += [{"drive": "street", "input": "full"} | row for row in measure(case)]
    assert [row["seconds"] for row in found["clock"]] == list(disturbed.CLOCK)
    assert [row["frames"] for row in found["stops"]] == [8, 8, 8, 8 + 3 * 29]
    assert found["repeated"][0]["equal"]
    assert all(row["ours_m"] < 1 for row in found["thinned"])
    assert found["sizes"][0]["base_m"] < 0.1
    told = page({"about": surroundings(()) | {"command": "none"}, **found})
    assert "| runs that repeat bit for bit | 1.000 | >= 1 | 1 of 1 | met |" in told
    assert "| street | full | standing longer | 95 |" in told


def test_the_page_says_what_was_met() -> None:
    case = {"drive": "street", "input": "16", "degenerate": 0, "lost": 2}
    found = {
        "clock": [case | {"seconds": 37.0, "apart_m": 0.5}, case | {"seconds": -2.0, "apart_m": 0.0}],
        "thinned": [
            case | {"step": 3, "ours_m": 0.02, "kiss_m": 0.01}, case | {"step": 2, "ours_m": 0.1, "kiss_m": None},
        ],
        "sizes": [case | {"base_m": 0.01, "scaled_m": {"0.75": 0.02, "1.5": 0.012}}],
        "stops": [],
    }  # fmt: skip
    told = page({"about": surroundings(()) | {"command": "none", "note": "In two parts."}, **found})
    assert "```\n\nIn two parts.\n\nOur odometry" in told
    for line in (
        "| distance to the undisturbed run, clock jumps [m] | 0.500 | <= 0.02 | 1 of 2 | missed |",
        "| error relative to KISS-ICP, every 2nd and 3rd frame | 2.000 | <= 1 | 0 of 1 | missed |",
        "| error relative to that with the default sizes | 2.000 | <= 1.5 | 0 of 1 | missed |",
        "| street | 16 | +37 | 0.5000 | 0 | 2 | missed |",
        "| street | 16 | 2 | 0.1000 | - | - | 0 | 2 | - |",
    ):
        assert line in told
    assert "Stops" not in told
