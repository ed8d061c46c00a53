"""Wrong extrinsics and late images are found, and right ones pass."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lidarlift.camera_check import camera_problems
from slam.calibration.check import camera_fault
from slam.calibration.observations import Parameters, View
from slam.data.cloud import Array
from slam.data.dataset import open_dataset

K = np.array([[300.0, 0.0, 240.0], [0.0, 300.0, 75.0], [0.0, 0.0, 1.0]])
T = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.15], [1, 0, 0, -0.25], [0, 0, 0, 1.0]])


def turned(axis: int, degrees: float) -> Array:
    change = np.zeros(Parameters.SIZE)
    change[axis] = np.deg2rad(degrees)
    return Parameters(T).changed(change).T


def test_right_extrinsics_pass(views: Sequence[View]) -> None:
    assert camera_fault(views, K, T) is None


@pytest.mark.parametrize(("axis", "name"), enumerate(("pitch", "yaw", "roll")))
def test_two_degrees_are_found(views: Sequence[View], axis: int, name: str) -> None:
    fault = camera_fault(views, K, turned(axis, 2.0))
    assert fault is not None
    assert f"deg in {name}" in fault
    assert "lidarlift calibrate" in fault


@pytest.mark.parametrize(("frames", "word"), [(1, "0.10 s late"), (-1, "0.10 s early")])
def test_images_of_the_next_frame_are_late(views: Sequence[View], frames: int, word: str) -> None:
    inner = range(1, len(views) - 1)
    fault = camera_fault([replace(views[at], grey=views[at + frames].grey) for at in inner], K, T)
    assert fault is not None
    assert word in fault


def test_too_few_views_tell_nothing(views: Sequence[View]) -> None:
    assert camera_fault(views[:4], K, turned(1, 2.0)) is None


def test_a_run_reports_the_fault(recorded: Path) -> None:
    data: Any = open_dataset(recorded)
    still = np.tile(np.eye(4), (len(data), 1, 1))
    source = SimpleNamespace(positions=range(len(data)))
    run: Any = SimpleNamespace(source=source, records=range(len(data)), odometry_poses=still, stamps=data.stamps)
    assert camera_problems(data, run) == ()
    data.calibration = replace(data.calibration, T_camera_lidar=turned(1, 2.0))
    (problem,) = camera_problems(data, run)
    assert problem.kind == "camera"
    assert "deg in yaw" in problem.message


@pytest.mark.parametrize("suffix", [".pcd", ".png"])
def test_files_that_are_gone_do_not_end_a_run(recorded: Path, tmp_path: Path, suffix: str) -> None:
    """The check reads frames again after the run, which may have taken hours."""
    folder = Path(shutil.copytree(recorded, tmp_path / "copy"))
    data: Any = open_dataset(folder)
    still = np.tile(np.eye(4), (len(data), 1, 1))
    source = SimpleNamespace(positions=range(len(data)))
    run: Any = SimpleNamespace(source=source, records=range(len(data)), odometry_poses=still, stamps=data.stamps)
    for file in folder.rglob(f"*{suffix}"):
        file.unlink()
    assert camera_problems(data, run) == ()
