"""`lidarlift evaluate`: the same figures whichever frame a trajectory is in."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.pose_files import read_poses

Command = Callable[..., Any]


def test_camera_poses_evaluate_to_the_same_ate(lidarlift: Command, finished: Path) -> None:
    """Rigidly joined bodies: a constant lever arm, so nearly the same figure; with --calib the same body, the same."""
    truth = finished.parent.parent / "poses" / "77.txt"
    expected = json.loads(Path("r/metrics.json").read_text())["slam"]["ate"]["aligned"]["rmse"]
    assert lidarlift("export", "r", "camera.txt", "--format", "kitti", "--frame", "camera").code == 0
    exported = read_poses(Path("camera.txt"))[1]
    assert exported == pytest.approx(read_poses(truth)[1], abs=0.05)
    np.testing.assert_allclose(exported[0], np.eye(4), atol=1e-9)
    result = lidarlift("evaluate", "camera.txt", truth)
    assert result.code == 0, result.err
    assert result.ate == pytest.approx(expected, abs=1.5e-3)
    result = lidarlift("evaluate", "r/trajectory_kitti.txt", truth, "--calib", finished / "calib.txt")
    assert result.code == 0, result.err
    assert result.ate == pytest.approx(expected, abs=5.1e-4)


def test_lidar_poses_against_camera_poses_are_an_error(lidarlift: Command, finished: Path) -> None:
    truth = finished.parent.parent / "poses" / "77.txt"
    lidarlift("evaluate", "r/trajectory_kitti.txt", truth).refused("--calib")
    lidarlift("evaluate", "r/trajectory_kitti.txt", truth, "--calib", "nowhere.txt").refused("nowhere.txt")
