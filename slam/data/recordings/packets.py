"""Messages with a LiDAR's packets, as its driver records them instead of point clouds."""

from __future__ import annotations

import struct
from collections.abc import Callable

from slam.data.packets.velodyne import PACKET
from slam.data.point_blocks import UnreadableError
from slam.data.recordings.container import ROS1, number
from slam.data.recordings.messages import VELODYNE_SCAN, byte_order, header_of

#: Time [ns, 0 where it is not said] and bytes of each packet in a message.
Packets = list[tuple[int, bytes]]


def velodyne_scan(content: bytes, encoding: str) -> Packets:
    """Return the packets of a VelodyneScan.

    It is read here, since ROS 2 recordings in SQLite do not have its definition:

        Header header, VelodynePacket[] packets
        VelodynePacket: time stamp, uint8[1206] data

    Raises:
        UnreadableError: The message is damaged.
    """
    at = header_of(content, encoding).end
    if encoding == ROS1:
        order, stride = "<", 8 + PACKET
    else:  # CDR: numbers of 4 bytes lie at multiples of 4
        order, stride = byte_order(content), 8 + PACKET + -PACKET % 4
        at += -at % 4
    count, at = number(content, f"{order}I", at), at + 4
    if count and len(content) < at + (count - 1) * stride + 8 + PACKET:
        raise UnreadableError(f"{count} packets in {len(content)} bytes")
    found = []
    for begin in range(at, at + count * stride, stride):
        seconds, nanoseconds = struct.unpack_from(f"{order}II", content, begin)
        found.append((seconds * 10**9 + nanoseconds, content[begin + 8 : begin + 8 + PACKET]))
    return found


def packet_message(content: bytes, encoding: str) -> Packets:
    """Return the packet of a PacketMsg of Ouster's drivers, which is `uint8[] buf`.

    Raises:
        UnreadableError: The message is damaged.
    """
    order, at = ("<", 0) if encoding == ROS1 else (byte_order(content), 4)
    size = number(content, f"{order}I", at)
    payload = content[at + 4 : at + 4 + size]
    if len(payload) < size:
        raise UnreadableError(f"a packet of {size} bytes in {len(content)} bytes")
    return [(0, payload[: size - size % 4])]  # drivers before 2023 append a byte to packets, which have multiples of 4


#: Reader of a message by its type.
PACKETS: dict[str, Callable[[bytes, str], Packets]] = {
    VELODYNE_SCAN: velodyne_scan,
    **{f"{package}/msg/PacketMsg": packet_message for package in ("ouster_ros", "ouster_sensor_msgs", "ouster_msgs")},
}
