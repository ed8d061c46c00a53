"""What a simulated drive looks like on disk: KITTI's odometry benchmark, or a folder of scans with stamped points."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

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
    """Where the parts of a simulation go, and in what form."""

    def files(self, number: int) -> dict[str, Path]:
        """The files of a frame by the fields of `SimulatedFrame`, in the order in which they are written: the scan, the
        last, says that the frame is whole."""
        ...

    def write(self, frame: SimulatedFrame, number: int) -> None:
        """The files of one frame. Raises InputError where one cannot be written."""
        ...

    def write_surroundings(self, rig: Rig, stamps: Array) -> None:
        """All but the frames: calibration, sensor, stamps and true poses of the whole drive; `stamps` (N,) [s] are of
        mid-sweep."""
        ...


class KittiLayout:
    """KITTI's odometry benchmark: stamps and poses, of camera 0, at mid-sweep; points ring after ring."""

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
        _write_truth(files, frame)
        _write(files["scan"], _bin(frame.scan))

    def write_surroundings(self, rig: Rig, stamps: Array) -> None:
        """See `Layout`."""
        Tr = rig.T_camera0_lidar
        rows = {"P0": CAMERA.P2 * [1, 1, 1, 0], "P2": CAMERA.P2, "Tr": Tr[:3]}
        lines = (f"{name}: " + " ".join(f"{value:.12e}" for value in row.ravel()) for name, row in rows.items())
        write_text(self._sequence / "calib.txt", "\n".join(lines) + "\n")
        write_text(self._sequence / "times.txt", "".join(f"{stamp:e}\n" for stamp in stamps))
        correction = "vertical_correction_deg: 0.0\n"  # the loader's own for KITTI is that of KITTI's LiDAR
        write_text(self._sequence / "sensor.yaml", _lines(rig) + correction + _compensated(rig))
        poses = Tr @ rig.poses @ se3.inverse(Tr)
        write_text(self._folder / "poses" / f"{SEQUENCE}.txt", kitti_text(se3.inverse(poses[0]) @ poses))


class FolderLayout:
    """Scans as .pcd with rings and times, in the order in which the points were seen; see `UserFolder`.

    A sweep begins where the head points to the rear. The clock starts with the first sweep. poses.txt has
    T_world_lidar at the stamps, the LiDAR's poses at that instant of each sweep; images are of mid-sweep.
    """

    def __init__(self, folder: Path, period: float, stamp: str) -> None:
        self._folder, self._period, self._instant = folder, period, INSTANTS[stamp]

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
        _write_truth(files, frame)
        _write(files["scan"], _pcd(self._points(frame.scan)))

    def write_surroundings(self, rig: Rig, stamps: Array) -> None:
        """See `Layout`."""
        at = stamps - stamps[0] + self._instant * self._period
        poses = np.array([rig.sweep(index).at(self._instant) for index in range(len(stamps))])
        write_text(self._folder / "times.txt", "".join(f"{stamp:.9f}\n" for stamp in at))
        write_text(self._folder / "poses.txt", kitti_text(poses))
        matrices = {"K": rig.calibration.K, "T_camera_lidar": rig.calibration.T_camera_lidar}
        calibration = "".join(f"{name}: {matrix.tolist()}\n" for name, matrix in matrices.items())
        write_text(self._folder / "calib.yaml", calibration)
        write_text(self._folder / "sensor.yaml", _lines(rig) + _compensated(rig))

    def _points(self, scan: Scan) -> Array:
        """(N,) of FIELDS."""
        points = np.empty(len(scan.xyz), FIELDS)
        for axis, name in enumerate("xyz"):
            points[name] = scan.xyz[:, axis]
        points["intensity"], points["ring"] = scan.reflectance, scan.ring
        points["time"] = (scan.fraction - np.float32(self._instant)) * np.float32(self._period)
        return points[np.argsort(scan.fraction, kind="stable")]


def _lines(rig: Rig) -> str:
    """The sensor's name; and the lines of one whose own are nominal, which here they are not."""
    sensor = rig.lidar.sensor
    beams = np.column_stack([np.rad2deg(sensor.elevation), sensor.offset, np.rad2deg(sensor.azimuth)])
    return f"model: {sensor.name}\n" + (f"beams: {beams.tolist()}\n" if sensor.nominal else "")


def _compensated(rig: Rig) -> str:
    return f"motion_compensated: {'false' if rig.distort else 'true'}\n"


def _write_truth(files: dict[str, Path], frame: SimulatedFrame) -> None:
    """Image, depth and exact scan, where the frame has them."""
    if frame.image is not None:
        _write(files["image"], _png(frame.image[..., ::-1]))
    if frame.depth is not None:
        _write(files["depth"], _png(np.minimum(np.round(frame.depth * DEPTH_SCALE), 65535).astype(np.uint16)))
    if frame.exact is not None:
        _write(files["exact"], _bin(frame.exact))


def _bin(scan: Scan) -> bytes:
    return np.column_stack([scan.xyz, scan.reflectance]).tobytes()


def _png(image: Array) -> bytes:
    return cv2.imencode(".png", image, PNG)[1].tobytes()


def _pcd(points: Array) -> bytes:
    """A structured array (N,) as binary PCD, version 0.7."""
    types = [points.dtype[name] for name in points.dtype.names or ()]
    header = {
        "VERSION": "0.7",
        "FIELDS": " ".join(points.dtype.names or ()),
        "SIZE": " ".join(str(kind.itemsize) for kind in types),
        "TYPE": " ".join(kind.kind.upper() for kind in types),
        "COUNT": " ".join("1" for _ in types),
        "WIDTH": len(points),
        "HEIGHT": 1,
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": len(points),
        "DATA": "binary",
    }
    lines = "".join(f"{key} {value}\n" for key, value in header.items())
    return lines.encode() + points.tobytes()


def _write(path: Path, content: bytes) -> None:
    with written_beside(path) as temporary:
        temporary.write_bytes(content)
