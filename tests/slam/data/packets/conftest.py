"""Small recordings of packets, made by hand."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import dpkt
import numpy as np
import pytest

#: Four beams; a turn has 32 columns, 16 in a packet.
METADATA: dict[str, Any] = {
    "prod_line": "OS-1-4",
    "prod_sn": "123",
    "lidar_mode": "32x10",
    "beam_altitude_angles": [10.0, 0.0, -10.0, -20.0],
    "beam_azimuth_angles": [3.0, 1.0, -1.0, -3.0],
    "lidar_origin_to_beam_origin_mm": 15.806,
    "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1],
    "data_format": {
        "columns_per_frame": 32,
        "columns_per_packet": 16,
        "column_window": [0, 31],
        "pixels_per_column": 4,
    },
}
START = 1_700_000_000_000_000_000  # ns
STEP = 3_125_000  # ns a column: 32 in 0.1 s


def column_time(frame: int, column: int) -> int:
    """ns, of sweeps that follow one another without a break."""
    return START + (32 * frame + column) * STEP


def legacy_packet(frame: int, first: int, millimetres: int = 10_000, valid: bool = True, start: int = 0) -> bytes:
    """16 columns from `first` on, every pixel at the same range, its reflectivity the number of its beam."""
    parts = []
    for column in range(first, first + 16):
        parts.append(struct.pack("<QHHI", column_time(frame, column) - start, column, frame % 65536, 0))
        parts += [struct.pack("<IHHHH", millimetres, beam, 7, 9, 0) for beam in range(4)]
        parts.append(struct.pack("<I", 0xFFFFFFFF if valid else 0))
    return b"".join(parts)


def ethernet(payload: bytes, number: int = 0, port: int = 7502, source: bytes = b"\x0a\x00\x00\x01") -> bytes:
    udp = dpkt.udp.UDP(sport=port, dport=port, data=payload, ulen=8 + len(payload))
    ip = dpkt.ip.IP(src=source, dst=b"\x0a\x00\x00\x02", p=17, id=number, data=udp)
    return bytes(dpkt.ethernet.Ethernet(data=ip))


def fragments(payload: bytes, number: int, size: int = 1480) -> list[bytes]:
    """The same as Ethernet carries it."""
    udp = bytes(dpkt.udp.UDP(sport=7502, dport=7502, data=payload, ulen=8 + len(payload)))
    frames = []
    for at in range(0, len(udp), size):
        part = udp[at : at + size]
        more = dpkt.ip.IP_MF if at + size < len(udp) else 0
        header = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(part), number, more | at // 8, 64, 17, 0)
        frames.append(b"\x00" * 12 + b"\x08\x00" + header + b"\x0a\x00\x00\x01\x0a\x00\x00\x02" + part)
    return frames


def write_capture(path: Path, frames: Iterable[tuple[float, bytes]]) -> Path:
    with path.open("wb") as file:
        writer = (dpkt.pcapng if path.suffix == ".pcapng" else dpkt.pcap).Writer(file)
        for stamp, frame in frames:
            writer.writepkt(frame, stamp)
    return path


@pytest.fixture
def ouster_drive(tmp_path: Path) -> Callable[..., Path]:
    """A capture of whole sweeps, with their metadata beside it."""

    def make(sweeps: int = 4, name: str = "drive.pcap", millimetres: int = 10_000) -> Path:
        frames = []
        for sweep in range(sweeps):
            for first in (0, 16):
                stamp = (column_time(sweep, first) + 50_000_000) * 1e-9
                frames.append((stamp, ethernet(legacy_packet(sweep, first, millimetres))))
        path = write_capture(tmp_path / name, frames)
        path.with_suffix(".json").write_text(json.dumps(METADATA))
        return path

    return make


#: Of a VLP-16: 24 firings in 12 blocks, in the order in which its lasers fire.
VLP16 = (-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15)


def vlp16_packet(azimuth: int, microseconds: int, metres: float = 10.0, model: int = 0x22) -> bytes:
    """Blocks 40 hundredths of a degree apart from `azimuth` on, every laser's return at the same distance."""
    laser = b"".join(struct.pack("<HB", round(metres / 0.002), 100) for _ in range(32))
    blocks = [struct.pack("<HH", 0xEEFF, (azimuth + 40 * block) % 36000) + laser for block in range(12)]
    return b"".join(blocks) + struct.pack("<IBB", microseconds, 0x37, model)


def vlp16_turns(turns: float, offset: int = 0) -> list[bytes]:
    """Packets of a sensor that turns ten times a second from `offset` hundredths of a degree on: 75 a turn."""
    packets = np.arange(round(75 * turns))
    return [vlp16_packet(int(480 * at + offset) % 36000, int(at * 1e5 / 75) % 3_600_000_000) for at in packets]
