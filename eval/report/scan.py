"""One scan of a run as the odometry saw it, with its camera image: kept in the run folder for the report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from slam.data.atomic import written_beside
from slam.data.cloud import Array, Calibration, PointCloud
from slam.data.errors import InputError

FILE = "scan.npz"


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan after the front end, in the sensor's frame.

    Attributes:
        number: Number of the frame in its data set.
        cloud: The cloud that was passed to the odometry, before deskewing.
        image: (H, W, 3) uint8 RGB, None without one.
        calibration: Calibration of the camera, None without one.
    """

    number: int
    cloud: PointCloud
    image: Array | None = None
    calibration: Calibration | None = None


def save_scan(folder: Path, scan: Scan) -> None:
    """Write scan.npz into a run folder.

    Raises:
        InputError: The file cannot be written.
    """
    cloud = scan.cloud
    arrays: dict[str, Any] = {
        "number": scan.number,
        "xyz": cloud.xyz,
        "intensity": cloud.intensity,
        "sigma": cloud.sigma,
        "measured": cloud.measured,
    }
    if scan.image is not None:
        arrays["image"] = scan.image
    if scan.calibration is not None:
        camera = scan.calibration
        arrays |= {"K": camera.K, "T_camera_lidar": camera.T_camera_lidar}
        arrays |= {"distortion": np.array(camera.distortion), "fisheye": camera.fisheye}
    with written_beside(folder / FILE) as temporary:
        np.savez(temporary, **arrays)  # compressed, it would be half as large, and take a tenth of a second


def read_scan(folder: Path) -> Scan | None:
    """Return the scan in a run folder, None without one.

    Raises:
        InputError: The file is damaged.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as arrays:
            calibration = None
            if "K" in arrays:
                distortion, fisheye = tuple(arrays["distortion"].tolist()), bool(arrays["fisheye"])
                calibration = Calibration(arrays["K"], arrays["T_camera_lidar"], distortion, fisheye=fisheye)
            xyz, intensity, sigma, measured = (arrays[name] for name in ("xyz", "intensity", "sigma", "measured"))
            cloud = PointCloud(xyz, intensity, sigma=sigma, measured=measured)
            return Scan(int(arrays["number"]), cloud, arrays.get("image"), calibration)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(f"{path}: damaged ({type(error).__name__}: {error}); run again") from error
