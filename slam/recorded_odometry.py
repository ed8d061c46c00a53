"""The poses that another odometry has found, in place of ours."""

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

SIGMA = np.array([1e-4] * 3 + [1e-3] * 3)  # rad, m: a scan fits where it was put; how the poses drift is set elsewhere


class RecordedOdometry:
    """Poses from a file, KITTI or TUM format, one a scan of the drive, of the LiDAR.

    Poses of a camera, which move along z, are brought into the LiDAR's frame by the calibration, as those of KITTI's
    camera 0, or else of the camera that is calibrated.

    Args:
        path: The file.
        scans: N, how many the drive has.
        calibration: Of the drive's camera, None without one.

    Attributes:
        stamps: (N,) seconds, or None where the file has none.
        poses: (N, 4, 4) T_world_lidar.
        problems: What was done to them.

    Raises:
        InputError: The file cannot be read, has not as many poses as the drive has scans, stamps that do not rise, or
            poses of a camera, and there is no calibration.
    """

    def __init__(self, path: Path, scans: int, calibration: Calibration | None = None) -> None:
        found = read_whole_trajectory(path)
        self.stamps, self.poses, note = found.stamps, found.poses, w_first_note(path, found)
        self.problems = (Problem("order of quaternions", note),) if note else ()
        if len(self.poses) != scans:
            raise InputError(f"{path}: {len(self.poses)} poses for {scans} scans; one a scan is needed, in their order")
        if self.stamps is not None and (np.diff(self.stamps) <= 0).any():
            line = int(np.argmax(np.diff(self.stamps) <= 0)) + 2
            raise InputError(f"{path}: the stamp of line {line} is not later than the one before; sort or repair it")
        if body_frame(self.poses) == "camera":
            self.problems = (*self.problems, self._into_lidar_frame(path, calibration))

    def _into_lidar_frame(self, path: Path, calibration: Calibration | None) -> Problem:
        """Make the camera's poses the LiDAR's, and say so."""
        fault = f"{path}: its poses move along z, so they are a camera's, not the LiDAR's"
        if calibration is None:
            raise InputError(f"{fault}, and the drive has no calibration to convert them by; give the LiDAR's poses")
        T, camera = calibration.T_camera0_lidar, "KITTI's camera 0"
        if T is None:
            T, camera = calibration.T_camera_lidar, "the drive's camera"
        self.poses = into_lidar_frame(self.poses, T)
        return Problem("camera poses", f"{fault}; converted by the calibration, as those of {camera}")

    def stamped(self, frame: Frame, position: int) -> Frame:
        """The frame at that position of the drive, with the stamp that the file has for it."""
        return frame if self.stamps is None else replace(frame, stamp=float(self.stamps[position]))

    def steps(self, positions: range, *, sweep_duration: float, vertical_correction: float) -> RecordedSteps:
        """An odometry over these positions of the drive."""
        return RecordedSteps(self.poses[positions], sweep_duration, vertical_correction)


class RecordedSteps:
    """What `Odometry` does, with recorded poses (N, 4, 4): the first is made the identity."""

    def __init__(self, poses: Array, sweep_duration: float, vertical_correction: float) -> None:
        self._poses = se3.inverse(poses[0]) @ poses
        self._sweep_duration, self._vertical_correction = sweep_duration, vertical_correction
        self._next, self._stamp = 0, float("nan")
        self.sizes: Sizes | None = None  # nothing is registered

    def predict(self, stamp: float) -> Array:
        """The pose (4, 4) of the next scan."""
        del stamp
        return np.asarray(self._poses[self._next])

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """The next scan at its pose, deskewed by the motion since the one before."""
        pose, before = self._poses[self._next], self._poses[max(self._next - 1, 0)]
        elapsed = stamp - self._stamp if stamp > self._stamp else self._sweep_duration
        velocity = se3.log(se3.normalized(se3.inverse(before) @ pose)) / elapsed
        self._next, self._stamp = self._next + 1, stamp
        scan = correct_vertical(deskew(cloud, velocity), self._vertical_correction)
        return OdometryStep(pose, np.diag(SIGMA**2), "registered", None, scan, velocity=velocity)

    def settle(self) -> tuple[OdometryStep, ...]:
        """Recorded poses are never provisional: none."""
        return ()
