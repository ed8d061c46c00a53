"""Layouts of a simulated sequence on disk: KITTI's odometry benchmark, or a folder of scans with stamped points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.lib.recfunctions import repack_fields

from slam.data import se3
from slam.data.atomic import write_text, written_beside
from slam.data.cloud import Array
from slam.data.conventions import INSTANTS
from slam.data.depth_map import DEPTH_SCALE
from slam.data.pose_files import kitti_text
from slam.simulation.camera import CAMERA
from slam.simulation.lidar import Scan
from slam.simulation.rig import Rig, SimulatedFrame

SEQUENCE = "00"
#: As small as zlib's default makes it, and quicker.
PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY]
#: What a .pcd file has of each point: `time` in seconds after the scan's stamp, as Velodyne's driver for ROS has it.
FIELDS = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f4")])


class Layout(Protocol):
    """Layout of the files of a simulation."""

    def files(self, number: int) -> dict[str, Path]:
        """Return the files of a frame by the fields of `SimulatedFrame`, in the order of writing.

        The scan is the last one and marks the frame as complete.
        """
        ...

    def write(self, frame: SimulatedFrame, number: int) -> None:
        """Write the files of one frame.

        Raises:
            InputError: A file cannot be written.
        """
        ...

    def write_surroundings(self, rig: Rig, stamps: Array) -> None:
        """Write calibration, sensor, stamps and true poses of the sequence; `stamps` (N,) [s] are at mid-sweep."""
        ...

    def holds(self, count: int) -> bool:
        """Check whether one file, written by `put_together`, holds the first `count` frames."""
        ...

    def put_together(self, rig: Rig, count: int) -> None:
        """Write the first `count` frames as one file and remove theirs, in layouts that are one file."""
        ...


class KittiLayout:
    """KITTI's odometry benchmark: stamps and camera-0 poses at mid-sweep, points ring by ring."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._sequence = folder, folder / "sequences" / SEQUENCE

    def files(self, number: int) -> dict[str, Path]:
        """See `Layout`."""
        return {
            "image": self._sequence / f"image_2/{number:06d}.png",
            "depth": self._sequence / f"depth_2/{number:06d}.png",
            "exact": self._sequence / f"velodyne_exact/{number:06d}.bin",
            "scan": self._sequence / f"velodyne/{number:06d}.bin",
        }

    def write(self, frame: SimulatedFrame, number: int) -> None:
        """See `Layout`."""
        files = self.files(number)
        write_truth(files, frame)
        write_bytes(files["scan"], _bin(frame.scan))

    def write_surroundings(self, rig: Rig, stamps: Array) -> None:
        """See `Layout`."""
        Tr = rig.T_camera0_lidar
        rows = {"P0": CAMERA.P2 * [1, 1, 1, 0], "P2": CAMERA.P2, "Tr": Tr[:3]}
        lines = (f"{name}: " + " ".join(f"{value:.12e}" for value in row.ravel()) for name, row in rows.items())
        write_text(self._sequence / "calib.txt", "\n".join(lines) + "\n")
        write_text(self._sequence / "times.txt", "".join(f"{stamp:e}\n" for stamp in stamps))
        correction = "vertical_correction_deg: 0.0\n"  # the loader's own for KITTI is that of KITTI's LiDAR
        write_text(self._sequence / "sensor.yaml", sensor_text(rig) + correction)
        poses = Tr @ rig.poses @ se3.inverse(Tr)
        write_text(self._folder / "poses" / f"{SEQUENCE}.txt", kitti_text(se3.inverse(poses[0]) @ poses))

    def holds(self, count: int) -> bool:
        """See `Layout`."""
        return False

    def put_together(self, rig: Rig, count: int) -> None:
        """See `Layout`."""


class FolderLayout:
    """Scans as .pcd with ring and time, in the order of measurement; see `UserFolder`.

    A sweep begins where the head points to the rear. The clock starts with the first sweep. poses.txt has
    T_world_lidar at the stamps; images are of mid-sweep.

    Args:
        folder: Folder to write into.
        period: Duration of a sweep [s].
        stamp: Instant of a sweep to which stamps and poses refer.
        fill: Makes the points of a scan and its frame number, an array of the fields to write; by default FIELDS.
    """

    def __init__(
        self, folder: Path, period: float, stamp: str, fill: Callable[[Scan, int], Array] | None = None
    ) -> None:
        self._folder, self._period, self._instant = folder, period, INSTANTS[stamp]
        self._fill = fill or self._points

    def files(self, number: int) -> dict[str, Path]:
        """See `Layout`."""
        return {
            "image": self._folder / f"images/{number:06d}.png",
            "depth": self._folder / f"depth/{number:06d}.png",
            "exact": self._folder / f"exact/{number:06d}.bin",
            "scan": self._folder / f"scans/{number:06d}.pcd",
        }

    def write(self, frame: SimulatedFrame, number: int) -> None:
        """See `Layout`."""
        files = self.files(number)
        write_truth(files, frame)
        write_bytes(files["scan"], _pcd(self._fill(frame.scan, number)))

    def write_surroundings(self, rig: Rig, stamps: Array) -> None:
        """See `Layout`."""
        at = stamps - stamps[0] + self._instant * self._period
        poses = np.array([rig.sweep(index).at(self._instant) for index in range(len(stamps))])
        write_text(self._folder / "times.txt", "".join(f"{stamp:.9f}\n" for stamp in at))
        write_text(self._folder / "poses.txt", kitti_text(poses))
        matrices = {"K": rig.calibration.K, "T_camera_lidar": rig.calibration.T_camera_lidar}
        calibration = "".join(f"{name}: {matrix.tolist()}\n" for name, matrix in matrices.items())
        write_text(self._folder / "calib.yaml", calibration)
        write_text(self._folder / "sensor.yaml", sensor_text(rig))

    def holds(self, count: int) -> bool:
        """See `Layout`."""
        return False

    def put_together(self, rig: Rig, count: int) -> None:
        """See `Layout`."""

    def _points(self, scan: Scan, number: int) -> Array:
        """(N,) of FIELDS."""
        points = np.empty(len(scan.xyz), FIELDS)
        for axis, name in enumerate("xyz"):
            points[name] = scan.xyz[:, axis]
        points["intensity"], points["ring"] = scan.reflectance, scan.ring
        points["time"] = (scan.fraction - np.float32(self._instant)) * np.float32(self._period)
        return points[np.argsort(scan.fraction, kind="stable")]


def sensor_text(rig: Rig) -> str:
    """Return the content of sensor.yaml; it has the laser lines of a sensor whose built-in lines are nominal."""
    sensor = rig.lidar.sensor
    beams = np.column_stack([np.rad2deg(sensor.elevation), sensor.offset, np.rad2deg(sensor.azimuth)])
    lines = f"model: {sensor.name}\n" + (f"beams: {beams.tolist()}\n" if sensor.nominal else "")
    return f"{lines}motion_compensated: {'false' if rig.distort else 'true'}\n"


def write_truth(files: dict[str, Path], frame: SimulatedFrame) -> None:
    """Image, depth and exact scan, where the frame has them."""
    if frame.image is not None:
        write_bytes(files["image"], _png(frame.image[..., ::-1]))
    if frame.depth is not None:
        write_bytes(files["depth"], _png(np.minimum(np.round(frame.depth * DEPTH_SCALE), 65535).astype(np.uint16)))
    if frame.exact is not None:
        write_bytes(files["exact"], _bin(frame.exact))


def _bin(scan: Scan) -> bytes:
    return np.column_stack([scan.xyz, scan.reflectance]).tobytes()


def _png(image: Array) -> bytes:
    return cv2.imencode(".png", image, PNG)[1].tobytes()


def _pcd(points: Array) -> bytes:
    """A structured array, (N,) or organised (H, W), as binary PCD, version 0.7."""
    height, width = points.shape if points.ndim > 1 else (1, len(points))
    points = repack_fields(points)
    types = [points.dtype[name] for name in points.dtype.names or ()]
    header = {
        "VERSION": "0.7",
        "FIELDS": " ".join(points.dtype.names or ()),
        "SIZE": " ".join(str(kind.itemsize) for kind in types),
        "TYPE": " ".join(kind.kind.upper() for kind in types),
        "COUNT": " ".join("1" for _ in types),
        "WIDTH": width,
        "HEIGHT": height,
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": points.size,
        "DATA": "binary",
    }
    lines = "".join(f"{key} {value}\n" for key, value in header.items())
    return lines.encode() + points.tobytes()


def write_bytes(path: Path, content: bytes) -> None:
    """A file, whole or not at all."""
    with written_beside(path) as temporary:
        temporary.write_bytes(content)
