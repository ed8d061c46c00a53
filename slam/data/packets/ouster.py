"""Points of an Ouster from its packets.

Formulas: Ouster, Software User Manual, "Sensor Data", "Lidar Range to XYZ".
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any

import numpy as np

from slam.data.cloud import Array
from slam.data.packets.ouster_metadata import Metadata
from slam.data.packets.sweeps import Packet, Place, unwrapped
from slam.data.sensor import Sensor

POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("reflectivity", "<u2"), ("ring", "<u2"), ("t", "<u4")]
)  # t: ns from the first column of the sweep


class OusterDecoder:
    """Decoder of one Ouster. See `Decoder`.

    Args:
        metadata: Metadata of the sensor.
    """

    def __init__(self, metadata: Metadata) -> None:
        self.metadata = metadata
        self.name = f"Ouster {metadata.name}"

    @property
    def sensor(self) -> Sensor:
        """The laser lines, by the sensor's own calibration."""
        return self.metadata.sensor

    def frame_of(self, payload: bytes) -> int | None:
        """Return the number of a packet's sweep, 0 to 65535; None if it is no packet with points."""
        if len(payload) != self.metadata.packet.itemsize:
            return None
        if self.metadata.profile.legacy:
            return int(struct.unpack_from("<H", payload, 10)[0])
        kind, frame = struct.unpack_from("<HH", payload)
        return int(frame) if kind == 1 else None

    def placing(self) -> Callable[[bytes], Place | None]:
        """See `Decoder`."""
        count = unwrapped(1 << 16)
        column, columns = self.metadata.column, self.metadata.columns_per_packet
        assert column.fields is not None
        begin, status_at = 0 if self.metadata.profile.legacy else 32, column.fields["status"][1]
        starts = range(begin, begin + columns * column.itemsize, column.itemsize)

        def place(payload: bytes) -> Place | None:
            frame = self.frame_of(payload)
            if frame is None:
                return None
            valid = next((start for start in starts if payload[start + status_at] & 1), None)
            seconds = np.nan if valid is None else struct.unpack_from("<Q", payload, valid)[0] * 1e-9
            return Place(count(frame), frame, seconds)

        return place

    def points(self, packets: Iterable[Packet]) -> Array:
        """Return the points of a sweep, (N,) `POINT`. See `decode`."""
        return decode((payload for _, payload in packets), self.metadata, self._rays)

    @cached_property
    def _rays(self) -> tuple[Array, Array]:
        return rays(self.metadata)


def rays(metadata: Metadata) -> tuple[Array, Array]:
    """Return the rays of each column and beam in the sensor's frame: a point is direction * range + origin.

    Returns:
        Directions (C, R, 3), unit vectors, and origins (C, R, 3) [m], of C columns and R beams.
    """
    along, up = metadata.beam_origin
    head = 2 * np.pi * (1 - np.arange(metadata.columns) / metadata.columns)
    angle, flat = head[:, None] - metadata.azimuth, np.cos(metadata.altitude)
    direction = np.stack(
        [flat * np.cos(angle), flat * np.sin(angle), np.broadcast_to(np.sin(metadata.altitude), angle.shape)], axis=-1
    )
    begin = np.stack([along * np.cos(head), along * np.sin(head), np.full(len(head), up)], axis=-1)
    origin = begin[:, None] - np.hypot(along, up) * direction  # ranges count from the axis on
    rotation, translation = metadata.T_sensor_lidar[:3, :3], metadata.T_sensor_lidar[:3, 3]
    return direction @ rotation.T, origin @ rotation.T + translation


def decode(packets: Iterable[bytes], metadata: Metadata, along: tuple[Array, Array] | None = None) -> Array:
    """Decode the points of a sweep, first returns only, column by column.

    Args:
        packets: The packets with points of one sweep, in any order; longer ones are cut to the sensor's length.
        metadata: Metadata of the sensor.
        along: `rays` of the sensor, None to compute them.

    Returns:
        A structured array (N,) `POINT`; t [ns] from the first column.
    """
    size = metadata.packet.itemsize
    whole = [bytes(payload[:size]) for payload in packets if len(payload) >= size]
    columns: Array = np.frombuffer(b"".join(whole), metadata.packet)["columns"].ravel()
    columns = columns[(columns["status"] & 1 > 0) & (columns["number"] < metadata.columns)]
    columns = columns[np.unique(columns["number"], return_index=True)[1]]
    columns = columns[np.argsort(columns["time"], kind="stable")]
    pixels = columns["pixels"]
    count = pixels["range"] & ((1 << metadata.profile.range_bits) - 1)
    at, beam = np.nonzero(count)
    direction, origin = along or rays(metadata)
    number = columns["number"][at]
    reach = count[at, beam].astype(np.float64) * metadata.profile.unit
    xyz = direction[number, beam] * reach[:, None] + origin[number, beam]
    points = np.empty(len(at), POINT)
    for axis, name in enumerate("xyz"):
        points[name] = xyz[:, axis]
    points["reflectivity"] = pixels["reflectivity"][at, beam]
    points["ring"] = metadata.ring[beam]
    points["t"] = (columns["time"] - columns["time"].min(initial=_LAST))[at]
    return points


_LAST: Any = np.uint64(2**64 - 1)
