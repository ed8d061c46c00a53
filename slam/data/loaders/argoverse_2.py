"""Argoverse 2's sensor data set (Wilson et al., NeurIPS 2021): two Velodyne VLP-32C and cameras on cars in the USA."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError
from slam.data.feather import read_table
from slam.data.loaders.common import HERE, StampedSequence, poses_of
from slam.data.point_files import Reading
from slam.data.pose_files import Trajectory
from slam.data.problem import Problem

LIDAR, CAMERA = "up_lidar", "ring_front_center"
POSE = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")


class Argoverse2(StampedSequence):
    """`sensors/lidar/<ns>.feather` of one log, with `calibration/`, `city_SE3_egovehicle.feather` and the front camera.

    A scan combines both LiDARs, in the car's frame, with the motion compensated to the stamp, the start of the sweep
    (av2-api, datasets/sensor/README.md and issue 204): there are no times, and no rings, since each LiDAR has its own.
    Points and ground truth are moved into the frame of the upper LiDAR. The camera is ring_front_center, whose images
    are delivered without distortion, matched by time. Other cameras, annotations and maps are not read. Feather files
    require pyarrow.
    """

    LAYOUT = "Argoverse 2 (sensors/lidar/*.feather)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the logs at or below a path, or in its splits, by their names. See `Loader`."""
        for pattern in (".", "*", "*/*"):
            folders = [folder.parent.parent for folder in sorted(path.glob(f"{pattern}/sensors/lidar"))]
            found = {folder.name: folder for folder in folders if any((folder / "sensors/lidar").glob("*.feather"))}
            if found:
                return found
        return {}

    def __init__(self, path: Path, sensor: str | Path | None = None, *, stamp: str | None = None) -> None:
        T_ego = _sensor_poses(path)
        T_ego_lidar = T_ego.get(LIDAR, np.eye(4))
        axes = tuple(tuple(float(value) for value in row) for row in se3.inverse(T_ego_lidar)[:3])
        super().__init__(
            path,
            f"Argoverse 2 {path.name}",
            path / "sensors" / "lidar",
            ".feather",
            "ns",
            Reading(offset=HERE, axes=axes),  # type: ignore[arg-type]  # four numbers a row
            sensor=sensor,
            instant="start",
            stamp=stamp,
            compensated=True,
        )
        if LIDAR not in T_ego:
            text = f"{path / 'calibration'}: no pose of {LIDAR}; points and truth stay in the car's frame"
            self.note(Problem("no calibration", f"{text}, and the camera is not used"))
        truth = path / "city_SE3_egovehicle.feather"
        if truth.is_file():
            table = read_table(truth, "timestamp_ns", *POSE)
            stamps = np.array([int(value) / 10**9 for value in table["timestamp_ns"]])
            poses = Trajectory(_poses(table), np.arange(len(stamps)), stamps)
            self.take_trajectory(truth, poses, T_ego_lidar)
        if LIDAR in T_ego and CAMERA in T_ego:
            self.calibration = Calibration(_intrinsics(path), se3.inverse(T_ego[CAMERA]) @ T_ego_lidar)
            self.take_images(path / "sensors" / "cameras" / CAMERA, "ns")


def _sensor_poses(path: Path) -> dict[str, Array]:
    """Return the pose (4, 4) of each sensor in the car's frame; none if the file is missing."""
    file = path / "calibration" / "egovehicle_SE3_sensor.feather"
    if not file.is_file():
        return {}
    table = read_table(file, "sensor_name", *POSE)
    return dict(zip(table["sensor_name"].tolist(), _poses(table), strict=True))


def _poses(table: dict[str, Array]) -> Array:
    values = np.column_stack([table[name] for name in POSE])
    return poses_of(values[:, 4:], Rotation.from_quat(values[:, :4], scalar_first=True))


def _intrinsics(path: Path) -> Array:
    file = path / "calibration" / "intrinsics.feather"
    table = read_table(file, "sensor_name", "fx_px", "fy_px", "cx_px", "cy_px")
    row = np.flatnonzero(table["sensor_name"] == CAMERA)
    if len(row) == 0:
        raise InputError(f"{file}: no row for {CAMERA}; copy it afresh")
    fx, fy, cx, cy = (float(table[name][row[0]]) for name in ("fx_px", "fy_px", "cx_px", "cy_px"))
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
