"""One sequence of the KITTI odometry benchmark, whole or in part."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data import se3
from slam.data.beams import rings_in_file_order, sweep_fraction
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.files import (
    IMAGE_SUFFIXES,
    SCAN_PERIOD,
    files_by_number,
    gaps,
    image_reader,
    matrix,
    missing_image,
    read_bin,
    read_keyed_numbers,
    read_numbers,
)
from slam.data.pose_files import read_poses
from slam.data.problem import Problem
from slam.data.sensor import kitti_sensor


class KittiOdometry:
    """`velodyne/`, `image_2/`, `calib.txt`, `times.txt` of one sequence folder, and `poses/NN.txt` of its root.

    Lines of times.txt and of the poses belong to scans by the number in the file name, so a part of a sequence works
    with the files of the whole. Scans are stored ring after ring, top ring first, and motion-compensated, unless a
    sensor.yaml beside them says that they are not: then the cloud has times, as KITTI's raw drives do. See `Dataset`
    for the fields. Raises InputError where there are no scans or a file holds something else than it should.
    """

    def __init__(self, path: Path, sensor: str | Path | None = None) -> None:
        self.path = path
        self.name = f"KITTI odometry {path.name}"
        self.sensor = kitti_sensor(path, sensor, motion_compensated=True)
        self._scans = files_by_number(path / "velodyne", (".bin",))
        if not self._scans:
            raise InputError(f"{path / 'velodyne'}: no scans in it; files like 000000.bin are expected")
        self._images = files_by_number(path / "image_2", IMAGE_SUFFIXES)
        self.numbers = np.array(list(self._scans), np.int64)
        self.stamps, slow = self._read_stamps()
        self.calibration, uncalibrated = self._read_calibration()
        self.ground_truth, untrue = self._read_ground_truth()
        self.problems = (*gaps(self.numbers, path / "velodyne"), *slow, *uncalibrated, *untrue)

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, position: int) -> Frame:
        number = int(self.numbers[position])
        xyz, intensity, problems = read_bin(self._scans[number])
        ring, odd = rings_in_file_order(xyz, self.sensor, self._scans[number])
        time = None if self.sensor.motion_compensated else sweep_fraction(xyz)
        image = self._images.get(number)
        if self._images:
            problems += missing_image(image, number, self.path / "image_2")
        return Frame(
            index=number,
            stamp=float(self.stamps[position]),
            cloud=PointCloud(xyz, intensity, ring, time),
            calibration=self.calibration,
            read_image=image_reader(image),
            problems=problems + odd,
        )

    def _read_stamps(self) -> tuple[Array, tuple[Problem, ...]]:
        path = self.path / "times.txt"
        times = read_numbers(path) if path.exists() else np.zeros(0)
        if len(times) > self.numbers[-1]:
            stamps = times[self.numbers]
            if (np.diff(stamps) > 0).all():
                return stamps, ()
            fault = "times do not rise from line to line"
        else:
            fault = f"{len(times)} times, but a scan {self.numbers[-1]}" if path.exists() else "no such file"
        problem = Problem("no time stamps", f"{path}: {fault}; {1 / SCAN_PERIOD:g} scans a second assumed")
        return self.numbers * SCAN_PERIOD, (problem,)

    def _read_calibration(self) -> tuple[Calibration | None, tuple[Problem, ...]]:
        path = self.path / "calib.txt"
        if not path.exists():
            return None, (Problem("no calibration", f"{path}: no such file; the camera is not used"),)
        entries = read_keyed_numbers(path)
        if "Tr" not in entries or "P2" not in entries:
            return None, (Problem("no calibration", f"{path}: no 'Tr:' or no 'P2:' in it; the camera is not used"),)
        T_camera0_lidar = matrix(entries, path, "Tr")
        return rectified_camera(matrix(entries, path, "P2"), T_camera0_lidar), ()

    def _read_ground_truth(self) -> tuple[Array | None, tuple[Problem, ...]]:
        path = self.path.parent.parent / "poses" / f"{self.path.name}.txt"
        if not path.exists():
            return None, ()
        if self.calibration is None:
            text = f"{path}: left out, for without calib.txt's 'Tr:' camera poses say nothing of the LiDAR's"
            return None, (Problem("no ground truth", text),)
        stamps, poses = read_poses(path)
        if stamps is not None:
            raise InputError(f"{path}: 8 columns; KITTI's poses have 12, the rows of a 3x4 matrix")
        T_camera_lidar = self.calibration.T_camera0_lidar
        assert T_camera_lidar is not None
        truth = np.full((len(self.numbers), 4, 4), np.nan)
        known = self.numbers < len(poses)
        truth[known] = se3.inverse(T_camera_lidar) @ poses[self.numbers[known]] @ T_camera_lidar
        if known.all():
            return from_first(truth), ()
        text = f"{path}: {len(poses)} poses, but a scan {self.numbers[-1]}; {np.sum(~known)} scans are without truth"
        return from_first(truth), (Problem("poses shorter than scans", text),)


def rectified_camera(P: Array, T_camera0_lidar: Array) -> Calibration:
    """KITTI's colour camera from its projection matrix P (4, 4, last row 0 0 0 1) = [K | K t] of rectified camera 0."""
    T_camera_camera0 = np.eye(4)
    T_camera_camera0[:3, 3] = np.linalg.solve(P[:3, :3], P[:3, 3])
    return Calibration(P[:3, :3].copy(), T_camera_camera0 @ T_camera0_lidar, (), T_camera0_lidar)


def from_first(poses: Array) -> Array | None:
    """Poses (N, 4, 4) in the frame of the first one that is not NaN; None where all are."""
    known = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
    return se3.inverse(poses[known[0]]) @ poses if len(known) else None
