"""LiDARs as the lines that their lasers see along."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.yaml_files import numbers, read_mapping, suggest


@dataclass(frozen=True, eq=False)
class Sensor:
    """A spinning LiDAR with R lasers; laser k, ring 0 = top, sees along z = tan(elevation[k]) * rho + offset[k].

    elevation            (R,) float64, radians
    offset               (R,) float64, metres: the height of the laser above the sensor's origin
    vertical_correction  angle [rad] that every elevation has to be raised by before registration (`correct_vertical`)
    motion_compensated   its scans have been deskewed by their maker and must not be deskewed again
    """

    name: str
    elevation: Array = field(repr=False)
    offset: Array = field(repr=False)
    vertical_correction: float = 0.0
    motion_compensated: bool = False

    @property
    def ring_count(self) -> int:
        """R, the number of lasers."""
        return len(self.elevation)


def load_sensor(name_or_file: str | Path) -> Sensor:
    """The built-in sensor of that name (`hdl64`, `vlp16`), or the one that a YAML file describes.

    Keys of the file: `model`, a built-in name or, with `beams`, any; `beams`, a list of [elevation_deg, offset_m], top
    first; `vertical_correction_deg`; `motion_compensated`. Raises InputError on an unknown name or key, with the
    nearest right one, and on values that make no sense.
    """
    return _from_file(Path(name_or_file)) if _is_file(name_or_file) else _built_in(str(name_or_file), "")


def _is_file(name_or_file: str | Path) -> bool:
    path = Path(name_or_file)
    return path.suffix.lower() in (".yaml", ".yml") or path.is_file()


def _built_in(name: str, where: str) -> Sensor:
    key = name.lower().replace("-", "").replace("_", "").replace(" ", "").removesuffix("e")
    if key not in BUILT_IN:
        hint = suggest(key, BUILT_IN)
        raise InputError(f"{where}unknown sensor '{name}'{hint}; other sensors are described in a sensor.yaml")
    return BUILT_IN[key]()


def _from_file(path: Path) -> Sensor:
    content = read_mapping(path, ("model", "beams", "vertical_correction_deg", "motion_compensated"))
    name = str(content.get("model", path.stem))
    if "beams" in content:
        beams = numbers(path, "beams", content["beams"], (-1, 2))
        if len(beams) == 0 or (np.diff(beams[:, 0]) >= 0).any() or (np.abs(beams[:, 0]) >= 90).any():
            raise InputError(f"{path}: 'beams' are [elevation_deg, offset_m], top first, falling, within 90 deg")
        sensor = Sensor(name, np.deg2rad(beams[:, 0]), beams[:, 1])
    elif "model" in content:
        sensor = _built_in(name, f"{path}: ")
    else:
        raise InputError(f"{path}: 'model' (one of {', '.join(BUILT_IN)}) or 'beams' is needed")
    correction = numbers(path, "vertical_correction_deg", content.get("vertical_correction_deg", 0.0), ())
    compensated = content.get("motion_compensated", False)
    if not isinstance(compensated, bool):
        raise InputError(f"{path}: 'motion_compensated' must be true or false, not '{compensated}'")
    return replace(sensor, vertical_correction=float(np.deg2rad(correction)), motion_compensated=compensated)


@lru_cache(maxsize=1)
def _hdl64() -> Sensor:
    text = resources.files("slam.data").joinpath("hdl64_lasers.csv").read_text(encoding="utf-8")
    _, elevation, offset = np.loadtxt(text.splitlines(), delimiter=",", unpack=True)
    return Sensor("hdl64", np.deg2rad(elevation), offset)


@lru_cache(maxsize=1)
def _vlp16() -> Sensor:
    """Velodyne VLP-16 user manual 63-9243, table of vertical angles and vertical corrections."""
    millimetres = [-11.2, -9.7, -8.1, -6.6, -5.1, -3.7, -2.2, -0.7, 0.7, 2.2, 3.7, 5.1, 6.6, 8.1, 9.7, 11.2]
    return Sensor("vlp16", np.deg2rad(np.arange(15.0, -16.0, -2.0)), np.array(millimetres) / 1000)


BUILT_IN = {"hdl64": _hdl64, "vlp16": _vlp16}


def sensor_of_folder(folder: Path, override: str | Path | None, default: Sensor | None = None) -> Sensor | None:
    """The sensor of a data set: its folder's sensor.yaml, else `default`, unless `override` says otherwise.

    A file overrides all of it; a built-in name says which lasers there are, and the folder's correction and motion
    compensation stay.
    """
    path = folder / "sensor.yaml"
    own = load_sensor(path) if path.is_file() else default
    if override is None:
        return own
    sensor = load_sensor(override)
    if own is None or _is_file(override):
        return sensor
    return replace(sensor, vertical_correction=own.vertical_correction, motion_compensated=own.motion_compensated)


def kitti_sensor(folder: Path, override: str | Path | None, motion_compensated: bool) -> Sensor:
    """The same for a KITTI folder, by default the HDL-64E as KITTI ran it.

    Its elevations are 0.205 deg too low (Deschaud, "IMLS-SLAM", ICRA 2018; the value is KISS-ICP's).
    """
    kitti = replace(_hdl64(), vertical_correction=float(np.deg2rad(0.205)), motion_compensated=motion_compensated)
    return sensor_of_folder(folder, override, kitti) or kitti
