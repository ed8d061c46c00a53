"""LiDARs, described by the lines along which their lasers see."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from slam.data import conventions
from slam.data.cloud import Array
from slam.data.conventions import Conventions, read_conventions
from slam.data.errors import InputError
from slam.data.problem import Problem
from slam.data.sensor_names import SENSORS
from slam.data.yaml_files import numbers, read_mapping, suggest

MAKERS = ("velodyne", "ouster", "hesai", "robosense")
KEYS = ("model", "beams", "vertical_correction_deg", "motion_compensated", *conventions.KEYS)
NEEDED = f"'model' (one of {', '.join(SENSORS.names())}) or 'beams' is needed"


@dataclass(frozen=True, eq=False)
class Sensor:
    """A spinning LiDAR with R lasers; laser k, ring 0 = top, sees along z = tan(elevation[k]) * rho + offset[k].

    Attributes:
        name: Name of the LiDAR.
        elevation: (R,) float64 [rad].
        offset: (R,) float64, height of each laser above the sensor's origin [m].
        vertical_correction: Angle [rad] that is added to every elevation before registration (`correct_vertical`).
        motion_compensated: Whether its scans were deskewed by their maker, and must not be deskewed again.
        azimuth: (R,) float64 [rad], angle to the left between the direction of the head and that of the laser.
        nominal: Whether the lines are the design's or another unit's, while each unit has a calibration of its own.
        source: Source of the lines.
    """

    name: str
    elevation: Array = field(repr=False)
    offset: Array = field(repr=False)
    vertical_correction: float = 0.0
    motion_compensated: bool = False
    azimuth: Array = field(default=None, repr=False)  # type: ignore[arg-type]  # zeros, filled in below
    nominal: bool = False
    source: str = ""

    def __post_init__(self) -> None:
        if self.azimuth is None:
            object.__setattr__(self, "azimuth", np.zeros(len(self.elevation)))
        if not len(self.elevation) == len(self.offset) == len(self.azimuth):
            raise ValueError(f"Sensor {self.name}: elevation, offset and azimuth are of different lengths")

    @property
    def ring_count(self) -> int:
        """Number of lasers R."""
        return len(self.elevation)

    def only(self, rings: Array) -> Sensor:
        """Return the LiDAR with some of its lasers: indices (K,) or a mask (R,)."""
        lines = {name: getattr(self, name)[rings] for name in ("elevation", "offset", "azimuth")}
        return replace(self, **lines)


def load_sensor(name_or_file: str | Path) -> Sensor:
    """Load a built-in LiDAR, or one that a file describes.

    Args:
        name_or_file: One of SENSORS; an Ouster's metadata (.json); or a YAML file with the keys `model`, a built-in
            name or, with `beams`, any; `beams`, a list of [elevation_deg, offset_m] or [elevation_deg, offset_m,
            azimuth_deg], top first; `vertical_correction_deg`; `motion_compensated`; and those of `Conventions`.

    Raises:
        InputError: A name or a key is unknown (the message has the most similar one), or a value is invalid.
    """
    if not is_sensor_file(name_or_file):
        return _built_in(str(name_or_file), "")
    if Path(name_or_file).suffix.lower() == ".json":
        from slam.data.packets.ouster_metadata import read_metadata

        return read_metadata(Path(name_or_file)).sensor
    sensor = _from_file(Path(name_or_file))
    if sensor is None:
        raise InputError(f"{name_or_file}: {NEEDED}")
    return sensor


def is_sensor_file(name_or_file: str | Path) -> bool:
    """Check whether this is a file that describes a sensor, not the name of a built-in one."""
    path = Path(name_or_file)
    return path.suffix.lower() in (".yaml", ".yml", ".json") or path.is_file()


def _built_in(name: str, where: str) -> Sensor:
    names = {_bare(known): known for known in SENSORS.names()}
    key = next((key for key in _spellings(name) if key in names), None)
    if key is None:
        hint = suggest(name.lower(), names.values())
        raise InputError(f"{where}unknown sensor '{name}'{hint}; other sensors are described in a sensor.yaml")
    return SENSORS.load(names[key])()


def _spellings(name: str) -> list[str]:
    """The name as it stands, and without parts of a full name: 'Velodyne HDL-64E', 'PandarXT-32', 'RS-LiDAR-16'."""
    key = _bare(name)
    for maker in MAKERS:
        key = key.removeprefix(maker).replace("lidar", "")
    return [found.removesuffix("e") for found in (_bare(name), key, key.removeprefix("pandar"), f"rs{key}")]


def _bare(name: str) -> str:
    return name.lower().replace("-", "").replace("_", "").replace(" ", "")


def _from_file(path: Path) -> Sensor | None:
    """The sensor of a YAML file, None if the file has only keys of `Conventions`."""
    content = read_mapping(path, KEYS)
    if content and not set(content) - set(conventions.KEYS):
        return None
    name = str(content.get("model", path.stem))
    if "beams" in content:
        sensor = _from_beams(path, name, content["beams"])
    elif "model" in content:
        sensor = _built_in(name, f"{path}: ")
    else:
        raise InputError(f"{path}: {NEEDED}")
    correction = numbers(path, "vertical_correction_deg", content.get("vertical_correction_deg", 0.0), ())
    compensated = content.get("motion_compensated", False)
    if not isinstance(compensated, bool):
        raise InputError(f"{path}: 'motion_compensated' must be true or false, not '{compensated}'")
    return replace(sensor, vertical_correction=float(np.deg2rad(correction)), motion_compensated=compensated)


def _from_beams(path: Path, name: str, rows: Any) -> Sensor:
    staggered = isinstance(rows, list) and all(isinstance(row, list) and len(row) == 3 for row in rows)
    beams = numbers(path, "beams", rows, (-1, 3 if staggered else 2))
    if len(beams) == 0 or (np.diff(beams[:, 0]) >= 0).any() or (np.abs(beams[:, 0]) >= 90).any():
        form = "[elevation_deg, offset_m] or [elevation_deg, offset_m, azimuth_deg]"
        raise InputError(f"{path}: 'beams' are {form}, top first, falling, within 90 deg")
    azimuth = np.deg2rad(beams[:, 2]) if staggered else np.zeros(len(beams))
    return Sensor(name, np.deg2rad(beams[:, 0]), beams[:, 1], azimuth=azimuth, source=path.name)


def sensor_of_folder(folder: Path, override: str | Path | None, default: Sensor | None = None) -> Sensor | None:
    """Return the sensor of a data set: that of its sensor.yaml, else `default`, None if unknown.

    Args:
        folder: The folder of the data set.
        override: A file replaces the sensor. A built-in name replaces the laser lines only: the folder says whether the
            scans are motion-compensated, and its vertical correction stays if the name is that of its own sensor.
        default: The sensor without sensor.yaml.

    Raises:
        InputError: As `load_sensor`.
    """
    path = folder / "sensor.yaml"
    own = (_from_file(path) if path.is_file() else None) or default
    if override is None:
        return own
    sensor = load_sensor(override)
    if own is None or is_sensor_file(override):
        return sensor
    correction = own.vertical_correction if own.name == sensor.name else sensor.vertical_correction
    return replace(sensor, vertical_correction=correction, motion_compensated=own.motion_compensated)


def nominal_lines(sensor: Sensor | None) -> tuple[Problem, ...]:
    """Return a Problem if the laser lines of a LiDAR are nominal."""
    if sensor is None or not sensor.nominal:
        return ()
    remedy = "lidarlift fit-lasers estimates them from raw scans"
    if sensor.name.startswith("os"):
        remedy = f"name the metadata that its tools write with a recording (--sensor FILE.json), or {remedy}"
    text = f"the laser lines of {sensor.name} are nominal, and each unit has lines of its own: {remedy}"
    return (Problem("nominal laser lines", text),)


def conventions_of_folder(folder: Path, override: str | Path | None) -> Conventions:
    """Return how the scans of a data set are to be read: by its sensor.yaml, and with precedence by a file `override`.

    Raises:
        InputError: A file has wrong keys or values.
    """
    said = [Path(override)] if override is not None and is_sensor_file(override) else []
    files = [folder / "sensor.yaml", *(path for path in said if path.suffix.lower() != ".json")]
    return read_conventions([path for path in files if path.is_file()], KEYS)


def kitti_sensor(folder: Path, override: str | Path | None, motion_compensated: bool) -> Sensor:
    """Return the sensor of a folder in KITTI's layout, by default the HDL-64E as KITTI ran it. See `sensor_of_folder`.

    The elevations of KITTI's HDL-64E are 0.205 deg too low (Deschaud, "IMLS-SLAM", ICRA 2018; the value is KISS-ICP's).
    Another LiDAR in KITTI's layout, as converters write it, has no such error.

    Args:
        folder: The folder.
        override: As in `sensor_of_folder`.
        motion_compensated: Whether the scans of this kind of folder are motion-compensated.

    Raises:
        InputError: As `load_sensor`.
    """
    correction = float(np.deg2rad(0.205))
    kitti = replace(load_sensor("hdl64"), vertical_correction=correction, motion_compensated=motion_compensated)
    return sensor_of_folder(folder, override, kitti) or kitti
