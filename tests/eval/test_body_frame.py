"""The calibration that leads from camera 0 to the LiDAR, and trajectories that are not of one body."""

import numpy as np
import pytest

from eval.body_frame import read_camera0_calibration, require_same_frame
from slam.data import se3
from slam.data.errors import InputError

#: The axes of camera 0 (x right, y down, z forward) in a LiDAR's (x forward, y left, z up), and a lever arm.
T_CAMERA0_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])


def drive(axis=0, count=30):
    """A bend of 0.5 m a pose, forward along the body's axis 0 (LiDAR) or 2 (camera)."""
    xi = np.array([0, 0, 0.02, 0.5, 0, 0]) if axis == 0 else np.array([0, -0.02, 0, 0, 0, 0.5])
    return np.array([se3.exp(k * xi) for k in range(count)])


def test_odometry_and_raw_calibration_files(tmp_path):
    odometry, raw = tmp_path / "calib.txt", tmp_path / "calib_velo_to_cam.txt"
    odometry.write_text("P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: " + " ".join(map(str, T_CAMERA0_LIDAR[:3].ravel())) + "\n")
    raw.write_text(
        "calib_time: 15-Mar-2012 11:37:16\nR: " + " ".join(map(str, T_CAMERA0_LIDAR[:3, :3].ravel()))
        + "\nT: 0.1 -0.2 -0.3\ndelta_f: 0 0\n"
    )  # fmt: skip
    np.testing.assert_allclose(read_camera0_calibration(odometry), T_CAMERA0_LIDAR)
    np.testing.assert_allclose(read_camera0_calibration(raw), T_CAMERA0_LIDAR)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("P0: 1 2 3\n", "no LiDAR-to-camera transform"),
        ("Tr: 1 2 3\n", "12 numbers"),
        ("Tr: " + "nan " * 12, "12 numbers"),
        ("Tr: a b c\n", "no LiDAR-to-camera transform"),
        ("Tr: " + "1 " * 12, "not a rotation"),
        ("R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n", "another pair of sensors"),
    ],
)
def test_broken_calibration(tmp_path, text, complaint):
    file = tmp_path / "calib.txt"
    file.write_text(text)
    with pytest.raises(InputError, match=complaint):
        read_camera0_calibration(file)


def test_missing_calibration(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_camera0_calibration(tmp_path / "calib.txt")


@pytest.mark.parametrize(
    ("estimate", "reference", "calibrated_from", "remedy"),
    [
        (0, 2, None, "--calib calib.txt"),
        (2, 0, None, "export the estimate in the LiDAR frame"),
        (0, 0, "lidar", "leave it out"),
        (2, 0, "camera", "leave --calib out"),
    ],
)
def test_refusals_say_what_to_do(estimate, reference, calibrated_from, remedy):
    with pytest.raises(InputError, match=remedy):
        require_same_frame(drive(estimate), drive(reference), ("a.txt", "b.txt"), calibrated_from)


def test_equal_or_unknown_frames_pass():
    standing = np.tile(np.eye(4), (30, 1, 1))
    for estimate, reference in [(drive(0), drive(0)), (drive(2), drive(2)), (standing, drive(2)), (drive(0), standing)]:
        require_same_frame(estimate, reference, ("a.txt", "b.txt"))
