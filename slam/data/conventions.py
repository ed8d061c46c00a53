"""What the stamps, point times, intensities and poses of a drive mean, where its owner says so."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from slam.data.errors import InputError
from slam.data.yaml_files import read_mapping, suggest

#: The instants of a sweep that a scan's stamp can belong to, as fractions of it.
INSTANTS = {"start": 0.0, "middle": 0.5, "end": 1.0}
#: Units of time, in seconds.
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Keys of a sensor.yaml that say how to read what lies beside it, not which LiDAR it was.
KEYS = ("stamp", "time_field", "full_intensity", "quaternion")
ORDERS = ("xyzw", "wxyz")


@dataclass(frozen=True)
class Conventions:
    """How a drive is to be read; what is None is found from its first scans.

    Attributes:
        stamp: The instant of a sweep that a scan's stamp, and so its pose, belongs to: 'start', 'middle' or 'end'.
        time_field: The field with the points' times, and
        time_unit: its unit, one of `UNITS`.
        full_intensity: The value in the files that stands for an intensity of 1.
        quaternion: The order of the quaternions in poses.txt, one of `ORDERS`.
    """

    stamp: str | None = None
    time_field: str | None = None
    time_unit: str | None = None
    full_intensity: float | None = None
    quaternion: str | None = None

    def over(self, others: Conventions) -> Conventions:
        """What `others` say, and this where they say nothing."""
        known = {field.name: value for field in fields(others) if (value := getattr(others, field.name)) is not None}
        return replace(self, **known)

    def said(self, stamp: str | None = None, point_time: str | None = None, where: str | None = None) -> Conventions:
        """The same with what somebody says: `point_time` is FIELD or FIELD:UNIT. `where` names the place for messages,
        by default the command line. Raises InputError on a word or unit that does not exist."""
        result = self
        if stamp is not None:
            if str(stamp) not in INSTANTS:
                raise InputError(f"{where or '--stamp'}: '{stamp}'{suggest(str(stamp), INSTANTS)}")
            result = replace(result, stamp=stamp)
        if point_time is not None:
            name, colon, unit = str(point_time).partition(":")
            if not name or (colon and unit not in UNITS):
                form = "FIELD or FIELD:UNIT is expected, UNIT one of s, ms, us, ns"
                raise InputError(f"{where or '--point-time'}: '{point_time}'; {form}")
            result = replace(result, time_field=name.lower(), time_unit=unit or None)
        return result


def read_conventions(files: list[Path], keys: tuple[str, ...]) -> Conventions:
    """What sensor files say, the later ones before the earlier; `keys` are all that may stand in them.

    Raises:
        InputError: A file is no mapping, has a key that is unknown or a value that makes no sense.
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
        raise InputError(f"{path}: full_intensity: '{value}'; the value that stands for full reflectance, as in 255")
    return float(value)
