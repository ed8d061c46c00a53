"""What a run depends on: a run that is resumed must have the same code, input and settings."""

from __future__ import annotations

import hashlib
import platform
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from slam.data.cloud import Calibration, PointCloud
from slam.data.dataset import Dataset
from slam.data.sensor import Sensor
from slam.recorded_odometry import RecordedOdometry
from slam.run import Source
from slam.settings import Config

PACKAGES = ("lidarlift", "numpy", "numba", "scipy", "gtsam", "onnxruntime", "open3d", "open3d-cpu", "evo")
OWN = ("slam", "enrichment", "lidarlift")  # packages whose files the results depend on
SHOWN = 3  # differences that an error lists


def identity(
    dataset: Dataset, positions: range, config: Config, recorded: RecordedOdometry | None = None
) -> dict[str, Any]:
    """Return what the results of a run depend on, as plain values.

    The input is known by its path, its stamps and numbers, its sensor and calibration, and the points of the first
    scan; a snapshot holds the fingerprint of its last scan too.
    """
    first = dataset[positions[0]]
    about = {
        "data set": dataset.name,
        "path": str(dataset.path),
        "frames": [positions.start, positions.stop, positions.step],
        "stamps": _digest(dataset.stamps, dataset.numbers),
        **_rig(dataset.sensor, dataset.calibration),
        "first scan": fingerprint(first.cloud),
        "odometry": None if recorded is None else _digest(recorded.poses),
    }
    return _identity(about, config)


def live_identity(source: Source, sweep_duration: float, config: Config) -> dict[str, Any]:
    """Return what the results of a live run depend on beside its scans, as `identity` does."""
    about = {"data set": source.name, "sweep_duration": sweep_duration, **_rig(source.sensor, source.calibration)}
    return _identity(about, config)


def _identity(input: dict[str, Any], config: Config) -> dict[str, Any]:
    version = {**versions(), "files of lidarlift": _digest_of_code()}
    return {"version": version, "input": input, "settings": config.model_dump(mode="json")}


def _rig(sensor: Sensor | None, camera: Calibration | None) -> dict[str, Any]:
    T = camera.T_camera0_lidar if camera else None
    return {
        "sensor": None if sensor is None else _digest(sensor.elevation, sensor.azimuth, sensor.offset),
        "calibration": None if camera is None else _digest(camera.K, camera.T_camera_lidar),
        "T_camera0_lidar": None if T is None else T.tolist(),
    }


def differences(session: Any, now: Any) -> list[str]:
    """List what differs between the identity of a session and that of a run, one sentence each."""
    changed = _differing("", session, now)
    return [f"{name} was {_short(before)} and is {_short(after)}" for name, before, after in changed]


def versions() -> dict[str, str]:
    """Return the versions of Python and of the installed PACKAGES; Open3D has two names."""
    installed = {"python": platform.python_version()}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            installed[name] = metadata.version(name)
    return installed


def fingerprint(cloud: PointCloud) -> int:
    """Return a checksum of the points of a scan."""
    return zlib.crc32(cloud.intensity.tobytes(), zlib.crc32(cloud.xyz.tobytes()))


def _differing(name: str, before: Any, after: Any) -> Iterator[tuple[str, Any, Any]]:
    """Names and both values of what differs, by sections; a value of each kind is named like a setting."""
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for key in {**before, **after}:
            yield from _differing(f"{name}.{key}" if name else str(key), before.get(key), after.get(key))
    elif before != after:
        yield name.removeprefix("settings."), before, after


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _digest(*arrays: Any) -> str:
    """A digest of arrays, with their shapes."""
    digest = hashlib.sha256()
    for values in arrays:
        array = np.ascontiguousarray(values)
        digest.update(str((array.shape, array.dtype)).encode())
        digest.update(array.tobytes())
    return digest.hexdigest()[:16]


@lru_cache
def _digest_of_code() -> str:
    """A digest of our packages' code and weights: versions of a development copy do not tell them apart."""
    digest = hashlib.sha256()
    for package in OWN:
        spec = find_spec(package)
        for root in spec.submodule_search_locations or () if spec else ():
            for path in sorted(Path(root).rglob("*")):
                if path.suffix in (".py", ".onnx", ".yaml"):
                    digest.update(str(path.relative_to(root)).encode())
                    digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
