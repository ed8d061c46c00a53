"""Points of a Velodyne from its packets, by velodyne-decoder.

It is an extra: `pip install 'lidarlift[packets]'`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import Any

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.packets.sweeps import Packet, Place
from slam.data.sensor import Sensor, load_sensor

PACKET = 1206  # bytes
BLOCK = 100  # bytes of the points of one or two firings
HOUR = 3600.0  # s, after which the clock of packets restarts
TURN, REAR = 36000, 18000  # hundredths of a degree
#: Last byte of a packet, and the built-in sensor that it denotes.
MODELS = {0x21: "hdl32", 0x22: "vlp16", 0x24: "puck-hires", 0x28: "vlp32c", 0xA1: "vls128"}
RETURNS = (0x37, 0x38, 0x39, 0x3A, 0x3B)  # values of the byte before it: strongest, last, both, ...
FIRST = 16  # packets that are read for the model
STRONGEST = 1  # bit of a point's return_type


class VelodyneDecoder:
    """Decoder of one Velodyne, whose turns begin with the first packet after the rear. See `Decoder`.

    Of two returns of a laser, the stronger one is used.

    Args:
        payloads: Its packets from the first on. They are read until the model is known; an HDL-64E states model and
            calibration in the last bytes of some 4,200 packets.
        where: The recording, for messages.

    Raises:
        InputError: velodyne-decoder is not installed, or the model is unknown.
    """

    def __init__(self, payloads: Iterable[bytes], where: object) -> None:
        self._library = _library(where)
        packets = iter(payloads)
        first = list(islice(packets, FIRST))
        model = _model(first)
        if model is None:
            self._config = self._hdl64(chain(first, packets), where)
            self.sensor: Sensor | None = replace(load_sensor("hdl64"), nominal=True)  # KITTI's
            self.name = "Velodyne HDL-64E"
        else:
            self._config = dict[str, Any]()
            self.sensor = load_sensor(model)
            self.name = f"Velodyne {self.sensor.name}"

    def _hdl64(self, payloads: Iterable[bytes], where: object) -> dict[str, Any]:
        reader = self._library.hdl64e
        try:
            status = reader.read_status_info(payloads)
            said = reader.status_info_to_calib_dict(status)
        except Exception as error:  # the library may raise anything on packets of something else
            raise InputError(
                f"{where}: packets of a Velodyne whose model and calibration are not in them ({error}); record more "
                "than 10 s of it, or convert it to .pcd files with the maker's driver"
            ) from error
        import yaml

        model = self._library.Model.HDL64E_S3 if status["Model"] == "S3" else self._library.Model.HDL64E_S2
        said.pop("status", None)
        return {"model": model, "calibration": self._library.Calibration.from_string(yaml.safe_dump(said))}

    def frame_of(self, payload: bytes) -> int | None:
        """Return 0 for a packet with points, None for another: the packets of turns do not mix."""
        return 0 if is_velodyne(payload) else None

    def placing(self) -> Callable[[bytes], Place | None]:
        """See `Decoder`."""
        number, before, hours, last = 0, -1, 0, -1.0

        def place(payload: bytes) -> Place | None:
            nonlocal number, before, hours, last
            if not is_velodyne(payload):
                return None
            azimuth = (struct.unpack_from("<H", payload, 2)[0] - REAR) % TURN
            number += azimuth < before - TURN // 2
            before = azimuth
            seconds = struct.unpack_from("<I", payload, PACKET - 6)[0] * 1e-6
            hours += seconds < last - HOUR / 2
            last = seconds
            return Place(number, 0, hours * HOUR + seconds)

        return place

    def points(self, packets: Sequence[Packet]) -> Array:
        """Return the points of a turn, (N,) with x y z intensity time ring; time [s] from its first packet."""
        vd = self._library
        decoder = vd.ScanDecoder(vd.Config(timestamp_first_packet=True, **self._config))
        _, points = decoder.decode(vd.PacketVector([vd.VelodynePacket(stamp, data) for stamp, data in packets]), True)
        strongest = points["return_type"] & STRONGEST > 0
        found: Array = points if strongest.all() or not strongest.any() else points[strongest]
        return found


def _model(packets: Sequence[bytes]) -> str | None:
    """The model, by the last two bytes of packets, which an HDL-64E uses for other data."""
    last = {packet[-2:] for packet in packets}
    mode, model = last.pop() if len(last) == 1 else (0, 0)
    return MODELS.get(model) if mode in RETURNS else None


def is_velodyne(payload: bytes) -> bool:
    """Return whether a datagram is a Velodyne's packet with points."""
    return len(payload) == PACKET and payload[:2] in (b"\xff\xee", b"\xff\xdd")


def decode(packets: Sequence[Packet], where: object) -> Array:
    """Return the points of the packets of one turn. See `VelodyneDecoder.points`."""
    return VelodyneDecoder([payload for _, payload in packets], where).points(packets)


def _library(where: object) -> Any:
    try:
        import velodyne_decoder
    except ImportError as error:
        raise InputError(
            f"{where}: packets of a Velodyne need velodyne-decoder: pip install 'lidarlift[packets]'"
        ) from error
    return velodyne_decoder
