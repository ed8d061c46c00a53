"""Calibration file of a user's cameras: calib.yaml."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError
from slam.data.yaml_files import checked_mapping, numbers, read_yaml, suggest

#: Names of the model with coefficients k1 k2 p1 p2 [k3 ...], and of the one with k1 k2 k3 k4.
PINHOLE = ("pinhole", "radtan", "plumb_bob", "brown", "opencv", "rational_polynomial")
FISHEYE = ("fisheye", "equidistant", "kannala_brandt", "opencv_fisheye")
KEYS = ("K", "T_camera_lidar", "distortion", "model")
LEAST_TANGENTIAL = 0.02  # lenses that are off centre have p1 and p2 of some thousandths; a fisheye's k3, k4 are larger


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera of a user's sequence.

    Attributes:
        calibration: Its calibration.
        images: Folder of its images, None for the usual one.
        name: Its name in the file, '' for a single camera.
        said: Where its images are, as the file says it; '' if it does not.
    """

    calibration: Calibration
    images: Path | None = None
    name: str = ""
    said: str = ""


def read_cameras(path: Path) -> list[Camera]:
    """Read the cameras of a calib.yaml, the one that looks most along the LiDAR's x axis first.

    Keys of a camera: `K` (3x3, pixels), `T_camera_lidar` (4x4, from the LiDAR's frame into the camera's) and, for
    images that are not rectified, `distortion` and its `model`: OpenCV's 4, 5, 8, 12 or 14 coefficients (PINHOLE, the
    default), or k1 k2 k3 k4 of its fisheye model (FISHEYE). Several cameras are listed under `cameras`, each with these
    keys under its name, and optionally `images`, the folder of its images (default: images/NAME).

    Raises:
        InputError: A key is missing; a value has a wrong shape or is no camera or rigid motion; the model is unknown;
            or four coefficients may be those of a fisheye, and no model is given.
    """
    content = read_yaml(path)
    if not isinstance(content, dict) or "cameras" not in content:
        return [Camera(_calibration(path, checked_mapping(path, content, KEYS)))]
    if len(content) > 1:
        extra = next(key for key in content if key != "cameras")
        raise InputError(f"{path}: '{extra}' beside 'cameras'; put it under the name of its camera")
    named = content["cameras"]
    if not isinstance(named, dict) or not named:
        raise InputError(f"{path}: 'cameras': names are expected, and under each K and T_camera_lidar")
    found = []
    for name, keys in named.items():
        where = f"cameras.{name}."
        keys = checked_mapping(path, keys, (*KEYS, "images"), where)
        folder = path.parent / str(keys.get("images", f"images/{name}"))
        found.append(Camera(_calibration(path, keys, where), folder, str(name), str(keys.get("images", ""))))
    return sorted(found, key=lambda camera: -camera.calibration.T_camera_lidar[2, 0])  # x component of its axis


def camera_named(path: Path, name: str | None) -> Camera:
    """Read one camera of a calib.yaml: by its name, or without one the camera that looks ahead.

    Raises:
        InputError: As `read_cameras`, or there is no camera of this name.
    """
    cameras = read_cameras(path)
    if name is None:
        return cameras[0]
    found = [camera for camera in cameras if camera.name == name]
    if not found:
        names = [camera.name for camera in cameras if camera.name]
        raise InputError(
            f"{path}: no camera '{name}'{suggest(name, names) if names else '; its one camera has no name'}"
        )
    return found[0]


def calibration_text(
    calibration: Calibration, beside: Path | None = None, name: str = "", comments: Sequence[str] = ()
) -> str:
    """Return the text of a calib.yaml.

    Args:
        calibration: The camera.
        beside: A calib.yaml whose other cameras are kept.
        name: Name of the camera in that file; '': the file has one camera, without a name.
        comments: Lines written above.
    """
    keys: dict[str, Any] = {"K": calibration.K.tolist(), "T_camera_lidar": calibration.T_camera_lidar.tolist()}
    if calibration.fisheye:
        keys["model"] = "fisheye"
    if calibration.distortion:
        keys["distortion"] = list(calibration.distortion)
    content = keys
    if beside is not None and name:
        content = read_yaml(beside)
        content["cameras"] = {str(each): dict(values) for each, values in content["cameras"].items()}
        content["cameras"][name] = {**content["cameras"][name], **keys}
    head = "".join(f"# {line}\n" for line in comments)
    return head + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120)


def _calibration(path: Path, content: dict[str, Any], where: str = "") -> Calibration:
    """The calibration from a camera's keys and values; `where` is the prefix of the keys in messages."""
    for key in ("K", "T_camera_lidar"):
        if key not in content:
            raise InputError(f"{path}: '{where}{key}' is missing")
    K = numbers(path, f"{where}K", content["K"], (3, 3))
    if K[0, 0] <= 0 or K[1, 1] <= 0 or not np.array_equal(K[2], [0, 0, 1]) or K[1, 0] != 0:
        raise InputError(f"{path}: '{where}K' must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx and fy in pixels")
    T = numbers(path, f"{where}T_camera_lidar", content["T_camera_lidar"], (4, 4))
    if not is_rigid(T):
        raise InputError(f"{path}: '{where}T_camera_lidar' must be a rotation and a translation over the row 0 0 0 1")
    distortion = numbers(path, f"{where}distortion", content.get("distortion") or [], (-1,))
    fisheye = _is_fisheye(path, content.get("model"), distortion)
    if fault := coefficients_fault(len(distortion), fisheye):
        raise InputError(f"{path}: {fault}")
    return Calibration(K, T, tuple(distortion.tolist()), fisheye=fisheye)


def is_rigid(T: Array) -> bool:
    """Check whether a matrix (4, 4) is a rotation, without a reflection, and a translation, to three digits."""
    R = T[:3, :3]
    rotation = np.allclose(R @ R.T, np.eye(3), atol=1e-3) and np.linalg.det(R) > 0
    return bool(rotation and np.isfinite(T).all() and np.allclose(T[3], [0, 0, 0, 1]))


def coefficients_fault(count: int, fisheye: bool) -> str:
    """Say what is wrong with the number of distortion coefficients of a model, '' if nothing is."""
    if count in ((0, 4) if fisheye else (0, 4, 5, 8, 12, 14)):
        return ""
    models = "OpenCV's fisheye model has 4" if fisheye else "OpenCV's models have 4, 5, 8, 12 or 14"
    return f"{count} distortion coefficients; {models}"


def _is_fisheye(path: Path, model: object, distortion: Array) -> bool:
    """Whether the model is a fisheye. Raises InputError if it is unknown, or missing where it is ambiguous."""
    fisheye = None if model is None else is_fisheye_model(str(model))
    if model is not None and fisheye is None:
        known = ", ".join(PINHOLE + FISHEYE)
        raise InputError(
            f"{path}: unknown model '{model}'; known: {known}; else rectify the images, and give the new K"
        )
    if model is None and len(distortion) == 4 and np.abs(distortion[2:]).max() > LEAST_TANGENTIAL:
        fault = f"'distortion' may be k1 k2 k3 k4 of a fisheye lens, for {distortion[2]:g} {distortion[3]:g} is much"
        raise InputError(f"{path}: {fault} for p1 p2; say model: pinhole, or model: fisheye")
    return bool(fisheye)


def is_fisheye_model(name: str) -> bool | None:
    """Return whether a model of lenses is the fisheye model, not the pinhole model; None for an unknown name."""
    plain = name.lower().replace("-", "_").replace(" ", "_")
    return plain in FISHEYE if plain in PINHOLE + FISHEYE else None
