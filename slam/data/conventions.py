"""Conventions of a sequence as the user states them: stamps, point times, intensities and quaternions."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from slam.data.errors import InputError
from slam.data.yaml_files import read_mapping, suggest

#: Instants of a sweep that a scan's stamp can refer to, as fractions of the sweep.
INSTANTS = {"start": 0.0, "middle": 0.5, "end": 1.0}
#: Units of time, in seconds.
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Keys of a sensor.yaml that describe how the files are read, not the LiDAR.
KEYS = ("stamp", "time_field", "full_intensity", "quaternion")
ORDERS = ("xyzw", "wxyz")


@dataclass(frozen=True)
class Conventions:
    """Conventions of a sequence; each that is None is estimated from the first scans.

    Attributes:
        stamp: Instant of the sweep that a scan's stamp, and so its pose, refers to: 'start', 'middle' or 'end'.
        time_field: Name of the field with the point times.
        time_unit: Unit of the point times, one of `UNITS`.
        full_intensity: Value in the files that corresponds to an intensity of 1.
        quaternion: Order of the quaternions in poses.txt, one of `ORDERS`.
    """

    stamp: str | None = None
    time_field: str | None = None
    time_unit: str | None = None
    full_intensity: float | None = None
    quaternion: str | None = None

    def over(self, others: Conventions) -> Conventions:
        """Return the conventions of `others`, and these where `others` have none."""
        known = {field.name: value for field in fields(others) if (value := getattr(others, field.name)) is not None}
        return replace(self, **known)

    def said(self, stamp: str | None = None, point_time: str | None = None, where: str | None = None) -> Conventions:
        """Return a copy with the given values.

        Args:
            stamp: One of `INSTANTS`.
            point_time: FIELD or FIELD:UNIT.
            where: Source of the values in error messages; by default the option of the command line.

        Raises:
            InputError: The instant or the unit is unknown.
        """
        result = self
        if stamp is not None:
            if str(stamp) not in INSTANTS:
                raise InputError(f"{where or '--stamp'}: unknown instant '{stamp}'{suggest(str(stamp), INSTANTS)}")
            result = replace(result, stamp=stamp)
        if point_time is not None:
            name, colon, unit = str(point_time).partition(":")
            if not name or (colon and unit not in UNITS):
                form = "FIELD or FIELD:UNIT is expected, UNIT one of s, ms, us, ns"
                raise InputError(f"{where or '--point-time'}: '{point_time}'; {form}")
            result = replace(result, time_field=name.lower(), time_unit=unit or None)
        return result


def read_conventions(files: list[Path], keys: tuple[str, ...]) -> Conventions:
    """Read the conventions in sensor files; later files override earlier ones.

    Args:
        files: YAML files.
        keys: All keys that the files may have.

    Raises:
        InputError: A file is not a mapping, or has an unknown key or an invalid value.
    """
    result = Conventions()
    for path in files:
        content = read_mapping(path, keys)
        result = result.said(content.get("stamp"), None, f"{path}: stamp")
        result = result.said(None, content.get("time_field"), f"{path}: time_field")
        if "full_intensity" in content:
            result = replace(result, full_intensity=_positive(path, content["full_intensity"]))
        if "quaternion" in content:
            if content["quaternion"] not in ORDERS:
                raise InputError(f"{path}: quaternion: '{content['quaternion']}'; xyzw or wxyz is expected")
            result = replace(result, quaternion=content["quaternion"])
    return result


def _positive(path: Path, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < float("inf"):
        expected = "a positive number is expected, the value of full reflectance, for example 255"
        raise InputError(f"{path}: full_intensity: '{value}'; {expected}")
    return float(value)
