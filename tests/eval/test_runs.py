"""Rows of a comparison, read from run folders or made of trajectories."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eval.loops import errors
from eval.runs import Track, read_run, read_truth, track_row
from slam.data.errors import InputError

Folder = Callable[..., Path]


def test_a_run_is_read_whole(run_folder: Folder) -> None:
    row = read_run("16", run_folder("a", 101.0))
    assert row.label == "16"
    assert row.track.poses.shape == (101, 4, 4)
    assert row.metrics is not None
    assert row.metrics.ate.origin.max == pytest.approx(1.0)
    assert row.run is not None
    assert row.run.odometry_metrics is not None
    assert row.run.report["peak_memory_mb"] == 512
    frames = row.run.frames
    assert frames.numbers.tolist() == list(range(101))
    assert frames.status[:3] == ("registered", "degenerate", "registered")
    assert frames.unobserved[:3].tolist() == [0, 1, 0]
    assert frames.inlier_ratio[:3] == pytest.approx([np.nan, 0.81, 0.92], nan_ok=True)
    assert list(frames.milliseconds) == ["load", "front_end", "odometry", "waiting"]
    accepted, rejected = row.run.loops
    assert (accepted.i, accepted.j, accepted.accepted, accepted.overlap) == (0, 2, True, 0.9)
    assert (rejected.accepted, rejected.reason) == (False, "descriptors differ")
    assert np.isnan(rejected.overlap)


def test_a_loop_is_measured_against_poses_of_its_frames(run_folder: Folder) -> None:
    row = read_run("16", run_folder("a", 101.0))
    assert row.run is not None
    truth = np.tile(np.eye(4), (2, 1, 1))
    truth[1, 0, 3] = 2.5  # of frame 2; the loop says 2 m, and frame 1 has no pose
    assert errors(row.run.loops, truth, [0, 2]) == pytest.approx([0.5, np.nan], nan_ok=True)


def test_a_run_without_ground_truth(run_folder: Folder) -> None:
    folder = run_folder("a", 101.0, reference=None)
    row = read_run("16", folder)
    assert row.metrics is None
    assert row.run is not None
    assert row.run.odometry_metrics is None
    assert read_truth(folder) is None


def test_a_run_without_keyframes_has_no_loops(run_folder: Folder) -> None:
    folder = run_folder("a", 101.0)
    (folder / "loops.csv").unlink()
    row = read_run("16", folder)
    assert row.run is not None
    assert row.run.loops == ()


@pytest.mark.parametrize("file", ["run.json", "trajectory_tum.txt", "odometry_tum.txt", "timings.csv", "loops.csv"])
def test_a_damaged_folder_is_named(run_folder: Folder, file: str) -> None:
    folder = run_folder("a", 101.0)
    (folder / file).write_text("frame,i,j\nx,y,z\n")
    with pytest.raises(InputError, match=str(folder)):
        read_run("16", folder)


def test_a_trajectory_of_another_system_is_evaluated(run_folder: Folder) -> None:
    truth = read_truth(run_folder("a", 101.0))
    assert truth is not None
    row = track_row("KISS-ICP", Track(truth.poses[::2], truth.stamps[::2] if truth.stamps is not None else None), truth)
    assert row.metrics is not None
    assert (row.metrics.frames, row.run) == (51, None)
    assert track_row("KISS-ICP", truth, None).metrics is None


def test_a_trajectory_that_cannot_be_associated_is_named(run_folder: Folder) -> None:
    truth = read_truth(run_folder("a", 101.0))
    assert truth is not None
    with pytest.raises(InputError, match="KISS-ICP: 50 poses against 101"):
        track_row("KISS-ICP", Track(truth.poses[:50]), truth)
