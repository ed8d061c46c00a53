"""Recorded poses of another odometry, in place of ours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from slam.cell_sizes import Sizes
from slam.data import se3
from slam.data.body_frame import body_frame, into_lidar_frame
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.distortion import correct_vertical, deskew
from slam.data.errors import InputError
from slam.data.pose_files import read_whole_trajectory, w_first_note
from slam.data.problem import Problem
from slam.odometry import OdometryStep

SIGMA = np.array([1e-4] * 3 + [1e-3] * 3)  # rad, m; nominal: the drift of the poses is a setting


class RecordedOdometry:
    """LiDAR poses from a file in KITTI or TUM format, one pose per scan of the sequence.

    Poses of a camera, which move along z, are transformed into the LiDAR's frame by the calibration: that of KITTI's
    camera 0, or else that of the calibrated camera.

    Args:
        path: The file.
        scans: Number N of scans of the sequence.
        calibration: Calibration of the camera, None without one.

    Attributes:
        stamps: Times (N,) [s], or None if the file has none.
        poses: T_world_lidar (N, 4, 4).
        problems: Conversions of the poses.

    Raises:
        InputError: The file cannot be read, the number of poses is not that of the scans, stamps do not rise, or the
            poses are a camera's and there is no calibration.
    """

    def __init__(self, path: Path, scans: int, calibration: Calibration | None = None) -> None:
        found = read_whole_trajectory(path)
        self.stamps, self.poses, note = found.stamps, found.poses, w_first_note(path, found)
        self.problems = (Problem("order of quaternions", note),) if note else ()
        if len(self.poses) != scans:
            raise InputError(
                f"{path}: {len(self.poses)} poses for {scans} scans; give one pose per scan, in the order of the scans"
            )
        if self.stamps is not None and (np.diff(self.stamps) <= 0).any():
            line = int(np.argmax(np.diff(self.stamps) <= 0)) + 2
            raise InputError(f"{path}: the stamp of line {line} is not later than the one before; sort or repair it")
        if body_frame(self.poses) == "camera":
            self.problems = (*self.problems, self._into_lidar_frame(path, calibration))

    def _into_lidar_frame(self, path: Path, calibration: Calibration | None) -> Problem:
        """Transform the camera's poses into the LiDAR's frame; return a note about it."""
        fault = f"{path}: the poses move along z, so they are those of a camera, not of the LiDAR"
        if calibration is None:
            raise InputError(f"{fault}, and the sequence has no calibration to convert them; give LiDAR poses")
        T, camera = calibration.T_camera0_lidar, "KITTI's camera 0"
        if T is None:
            T, camera = calibration.T_camera_lidar, "the calibrated camera"
        self.poses = into_lidar_frame(self.poses, T)
        return Problem("camera poses", f"{fault}; converted by the calibration of {camera}")

    def stamped(self, frame: Frame, position: int) -> Frame:
        """Return the frame at a position of the sequence with the stamp of the file."""
        return frame if self.stamps is None else replace(frame, stamp=float(self.stamps[position]))

    def steps(self, positions: range, *, sweep_duration: float, vertical_correction: float) -> RecordedSteps:
        """Return a pose source for these positions of the sequence."""
        return RecordedSteps(self.poses[positions], sweep_duration, vertical_correction)


class RecordedSteps:
    """Pose source, as `Odometry`, with recorded poses.

    Args:
        poses: T_world_lidar (N, 4, 4); the first pose becomes the identity.
        sweep_duration: Duration of a sweep [s].
        vertical_correction: Angle [rad] added to each elevation.

    Attributes:
        sizes: None: no scan is registered.
    """

    def __init__(self, poses: Array, sweep_duration: float, vertical_correction: float) -> None:
        self._poses = se3.inverse(poses[0]) @ poses
        self._sweep_duration, self._vertical_correction = sweep_duration, vertical_correction
        self._next, self._stamp = 0, float("nan")
        self.sizes: Sizes | None = None

    def predict(self, stamp: float) -> Array:
        """Return the pose (4, 4) of the next scan."""
        del stamp
        return np.asarray(self._poses[self._next])

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Return the next scan at its pose, deskewed by the motion since the last scan."""
        pose, before = self._poses[self._next], self._poses[max(self._next - 1, 0)]
        elapsed = stamp - self._stamp if stamp > self._stamp else self._sweep_duration
        velocity = se3.log(se3.normalized(se3.inverse(before) @ pose)) / elapsed
        self._next, self._stamp = self._next + 1, stamp
        scan = correct_vertical(deskew(cloud, velocity), self._vertical_correction)
        return OdometryStep(pose, np.diag(SIGMA**2), "registered", None, scan, velocity=velocity)

    def settle(self) -> tuple[OdometryStep, ...]:
        """Return no steps: recorded poses are never provisional."""
        return ()
