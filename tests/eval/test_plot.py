"""The picture: written whole, at a sensible size, also for sequences without motion."""

import cv2
import numpy as np
import pytest

from eval.plot import plot_run, plot_trajectory
from slam.data import se3
from slam.data.pose_files import tum_text


def drive(count=40):
    return np.array([se3.exp(k * np.array([0, 0, 0.05, 1.0, 0, 0])) for k in range(count)])


def standing(count=10):
    return np.tile(np.eye(4), (count, 1, 1))


def northward(count=40):
    return se3.exp(np.array([0, 0, np.pi / 2, 0, 0, 0])) @ np.array(
        [se3.exp(np.array([0, 0, 0, float(k), 0, 0])) for k in range(count)]
    )


@pytest.mark.parametrize(
    ("estimate", "reference"),
    [(drive(), drive()), (drive(), None), (standing(), standing()), (standing(1), None), (northward(), northward())],
    ids=["drive", "no truth", "standing", "one pose", "straight"],
)
def test_the_plot_of_a_trajectory_is_written(tmp_path, estimate, reference):
    plot_trajectory(tmp_path / "t.png", estimate, reference, "a drive")
    height, width, _ = cv2.imread(str(tmp_path / "t.png")).shape
    assert width == 1200
    assert 300 < height < 1800
    assert [path.name for path in tmp_path.iterdir()] == ["t.png"]


def test_plot_of_a_run_with_partial_ground_truth(tmp_path):
    stamps = 0.1 * np.arange(40)
    (tmp_path / "trajectory_tum.txt").write_text(tum_text(stamps, drive()))
    assert plot_run(tmp_path).is_file()
    (tmp_path / "ground_truth_tum.txt").write_text(tum_text(stamps[:30], drive(30)))
    assert plot_run(tmp_path, "with truth") == tmp_path / "trajectory.png"
