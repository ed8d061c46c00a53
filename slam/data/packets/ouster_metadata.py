"""Metadata of an Ouster, the JSON file beside a recording: its beams, its frames, and the layout of its packets."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.sensor import Sensor

MILLIMETRE = 0.001
#: Distance of the beams' origin from the axis [mm] that old firmware does not state: first generation, later ones.
BEAM_ORIGIN = {"OS-0": 27.67, "OS-1": 15.806, "OS-2": 13.762}
OLD_BEAM_ORIGIN = 12.163
#: Transform from the frame of the beams to that of the sensor, which old firmware does not state [mm].
LIDAR_TO_SENSOR = (-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1)


@dataclass(frozen=True)
class Profile:
    """Layout of a pixel.

    Attributes:
        size: Bytes of a pixel.
        range_bits: Bits of the first return's range, which is at the beginning.
        unit: Unit of the range [m].
        reflectivity: Offset of the first return's reflectivity.
        reflectivity_type: Type of the reflectivity.
        legacy: Whether packets are those of firmware before 2.2, with the frame's number in each column.
    """

    size: int
    range_bits: int
    reflectivity: int
    unit: float = MILLIMETRE
    reflectivity_type: str = "u1"
    legacy: bool = False


#: Ouster, Firmware User Manual, "Lidar Data Packet Format", and ouster-sdk's parsing.cpp.
PROFILES = {
    "LEGACY": Profile(12, 20, 4, reflectivity_type="<u2", legacy=True),
    "RNG19_RFL8_SIG16_NIR16": Profile(12, 19, 4),
    "RNG19_RFL8_SIG16_NIR16_ZONE16": Profile(12, 19, 4),
    "RNG19_RFL8_SIG16_NIR16_DUAL": Profile(16, 19, 3),
    "RNG19_RFL8_SIG16_ZONE16_DUAL": Profile(16, 19, 3),
    "RNG19_RFL8_SIG16_NIR16_RGB16": Profile(16, 19, 3),
    "RNG19_RFL8_SIG16_NIR16_RGB16_DUAL": Profile(20, 19, 3),
    "RNG15_RFL8_NIR8": Profile(4, 15, 2, 8 * MILLIMETRE),
    "RNG15_RFL8_WIN8": Profile(4, 15, 2, 8 * MILLIMETRE),
    "RNG15_RFL8_NIR8_DUAL": Profile(8, 15, 2, 8 * MILLIMETRE),
    "RNG15_RFL8_NIR8_ZONE16": Profile(8, 15, 2, 8 * MILLIMETRE),
    "FUSA_RNG15_RFL8_NIR8_DUAL": Profile(8, 15, 2, 8 * MILLIMETRE),
}


@dataclass(frozen=True, eq=False)
class Metadata:
    """Of one Ouster, with R beams, in the order in which a column has them.

    Attributes:
        name: The product line, like 'OS-1-32-G'.
        serial: Its serial number, 0 where it is not said.
        altitude: (R,) float64, radians: how far each beam points up.
        azimuth: (R,) float64, radians: how far to the right of the head's direction it points.
        beam_origin: Metres from the axis, and above the frame's origin, at which beams begin.
        T_sensor_lidar: (4, 4) from the frame in which the beams turn to the sensor's, metres.
        columns: Columns of a turn.
        window: First and last column of those that are sent.
        columns_per_packet: Columns in a packet.
        profile: How its pixels are laid out.
    """

    name: str
    serial: int
    altitude: Array = field(repr=False)
    azimuth: Array = field(repr=False)
    beam_origin: tuple[float, float]
    T_sensor_lidar: Array = field(repr=False)
    columns: int
    window: tuple[int, int]
    columns_per_packet: int
    profile: Profile

    @cached_property
    def column(self) -> np.dtype[Any]:
        """The layout of a column: time [ns], number, frame (legacy packets only), status (odd if valid), pixels."""
        profile, beams = self.profile, len(self.altitude)
        pixel = np.dtype(
            {
                "names": ["range", "reflectivity"],
                "formats": ["<u2" if profile.range_bits < 16 else "<u4", profile.reflectivity_type],
                "offsets": [0, profile.reflectivity],
                "itemsize": profile.size,
            }
        )
        head, tail = (16, 4) if profile.legacy else (12, 0)
        size = beams * profile.size
        return np.dtype(
            {
                "names": ["time", "number", "frame", "status", "pixels"],
                "formats": ["<u8", "<u2", "<u2", "<u4" if profile.legacy else "<u2", (pixel, (beams,))],
                "offsets": [0, 8, 10, head + size if profile.legacy else 10, head],
                "itemsize": head + size + tail,
            }
        )

    @cached_property
    def packet(self) -> np.dtype[Any]:
        """The layout of a packet with points, of several columns."""
        around = 0 if self.profile.legacy else 32
        return np.dtype(
            {
                "names": ["columns"],
                "formats": [(self.column, (self.columns_per_packet,))],
                "offsets": [around],
                "itemsize": 2 * around + self.columns_per_packet * self.column.itemsize,
            }
        )

    def misfit(self, payload: bytes) -> str:
        """Say why a packet with points is not of this sensor; '' if it may be."""
        if len(payload) != self.packet.itemsize:
            return f"by it packets have {self.packet.itemsize} bytes, but most have {len(payload)}"
        serial = 0 if self.profile.legacy else int.from_bytes(payload[7:12], "little")
        if serial and self.serial and serial != self.serial:
            return f"it is of sensor {self.serial}, but packets are of {serial}"
        return ""

    @cached_property
    def ring(self) -> Array:
        """(R,) uint16: the ring of each beam, 0 on top."""
        return np.argsort(np.argsort(-self.altitude, kind="stable")).astype(np.uint16)

    @cached_property
    def sensor(self) -> Sensor:
        """The laser lines.

        A beam begins off the vertical axis; its line is continued to the axis.
        """
        order = np.argsort(-self.altitude, kind="stable")
        along, up = self.beam_origin
        begins = self.T_sensor_lidar[2, 3] + up - along * np.cos(self.azimuth) * np.tan(self.altitude)
        return Sensor(self.name, self.altitude[order], begins[order], azimuth=-self.azimuth[order])


def read_metadata(path: Path) -> Metadata:
    """Read the metadata in a JSON file.

    Raises:
        InputError: As `parse_metadata`, or the file cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    return parse_metadata(text, path)


def parse_metadata(text: str, where: object) -> Metadata:
    """Read the metadata of an Ouster in JSON, as files and ROS topics have it.

    Args:
        text: The JSON text.
        where: Its origin, for messages.

    Raises:
        InputError: It is not an Ouster's, incomplete, or of a sensor with packets of an unknown profile.
    """
    try:
        content = json.loads(text)
    except ValueError as error:
        raise InputError(f"{where}: no JSON ({error}); an Ouster's metadata is needed") from error
    said = _flat(content if isinstance(content, dict) else {})
    if "beam_altitude_angles" not in said:
        raise InputError(
            f"{where}: has no 'beam_altitude_angles'; an Ouster's metadata is needed, as its tools write it"
        )
    altitude = _numbers(said, "beam_altitude_angles", None, where)
    azimuth = _numbers(said, "beam_azimuth_angles", len(altitude), where)
    mode = re.match(r"(\d+)x\d+$", str(said.get("lidar_mode", "")))
    columns = _whole(said, "columns_per_frame", int(mode.group(1)) if mode else None, where)
    name = str(said.get("prod_line") or "OS")
    kind = str(said.get("udp_profile_lidar", "LEGACY"))
    if kind not in PROFILES:
        raise InputError(f"{where}: packets of profile {kind} are not read; {', '.join(PROFILES)} are")
    serial = str(said.get("prod_sn", ""))
    return Metadata(
        name=name,
        serial=int(serial) if serial.isdigit() else 0,
        altitude=np.deg2rad(altitude),
        azimuth=np.deg2rad(azimuth),
        beam_origin=_beam_origin(said, name, where),
        T_sensor_lidar=_transform(said, "lidar_to_sensor_transform", LIDAR_TO_SENSOR, where),
        columns=columns,
        window=_window(said, columns, where),
        columns_per_packet=_whole(said, "columns_per_packet", 16, where),
        profile=PROFILES[kind],
    )


def _flat(content: Mapping[str, Any]) -> dict[str, Any]:
    """All keys in one mapping, as firmware before 3 has them; later firmware has groups."""
    groups = ("config_params", "beam_intrinsics", "lidar_intrinsics", "sensor_info", "data_format", "lidar_data_format")
    said = dict(content)
    for name in groups:
        if isinstance(content.get(name), dict):
            said.update(content[name])
    return said


def _numbers(said: Mapping[str, Any], key: str, count: int | None, where: object) -> Array:
    try:
        values = np.array(said[key], np.float64)
    except (KeyError, TypeError, ValueError):
        values = np.zeros((0, 0))
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all() or (count or len(values)) != len(values):
        wanted = f"{count} numbers" if count else "numbers"
        raise InputError(f"{where}: '{key}' must be {wanted}; save the metadata afresh")
    return values


def _whole(said: Mapping[str, Any], key: str, default: int | None, where: object) -> int:
    value = said.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 < value <= 8192:
        raise InputError(f"{where}: '{key}' is {value}, but a number of columns is needed; save the metadata afresh")
    return value


def _window(said: Mapping[str, Any], columns: int, where: object) -> tuple[int, int]:
    if "column_window" not in said:
        return 0, columns - 1
    first, last = _numbers(said, "column_window", 2, where)
    return int(first), int(last)


def _transform(said: Mapping[str, Any], key: str, default: tuple[float, ...], where: object) -> Array:
    values = _numbers({key: said.get(key, default)}, key, 16, where).reshape(4, 4)
    values[:3, 3] *= MILLIMETRE
    return values


def _beam_origin(said: Mapping[str, Any], name: str, where: object) -> tuple[float, float]:
    """Distance of the beams' origin from the axis, and its height [m]."""
    if "beam_to_lidar_transform" in said:
        transform = _transform(said, "beam_to_lidar_transform", (), where)
        return float(transform[0, 3]), float(transform[2, 3])
    usual = BEAM_ORIGIN.get(name[:4], OLD_BEAM_ORIGIN)
    along = _numbers({"": [said.get("lidar_origin_to_beam_origin_mm", usual)]}, "", 1, where)
    return float(along[0]) * MILLIMETRE, 0.0
