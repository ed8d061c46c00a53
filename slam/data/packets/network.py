"""UDP datagrams from frames of a network: Ethernet and other link types, IP and its fragments."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import NamedTuple

ETHERNET, RAW, LINUX, LINUX_2 = 1, (12, 14, 101, 228, 229), 113, 276  # tcpdump's LINKTYPE
LOOPBACK = (0, 108)
VLAN = (0x8100, 0x88A8, 0x9100)
IPV4, IPV6 = 0x0800, 0x86DD
UDP, FRAGMENT = 17, 44
EXTENSIONS = (0, 43, 60)  # headers of IPv6 with a length, between its own and UDP's
WAITING = 64  # incomplete datagrams that are kept; older ones are dropped


class Udp(NamedTuple):
    """A datagram.

    Attributes:
        sender: Address of the sender, and the port that it was sent to.
        payload: Its bytes.
        start: Place of its first frame in the file.
    """

    sender: tuple[bytes, int]
    payload: bytes
    start: int


class _Part(NamedTuple):
    """A part of an IP datagram: sender, receiver and number; offset in the datagram, and whether more parts follow."""

    key: tuple[bytes, bytes, int]
    offset: int
    more: bool
    content: bytes


@dataclass
class _Pieces:
    start: int
    parts: dict[int, bytes] = field(default_factory=dict)
    total: int | None = None


class Reassembly:
    """Reassembly of IP fragments; datagrams that stay incomplete are dropped."""

    def __init__(self) -> None:
        self._waiting: dict[tuple[bytes, bytes, int], _Pieces] = {}

    def add(self, part: _Part, start: int) -> tuple[bytes, int] | None:
        """Add a part; return the datagram that it completes and the place of its first part, or None."""
        if part.offset == 0 and not part.more:
            return part.content, start
        pieces = self._waiting.get(part.key)
        if pieces is not None and pieces.parts.get(part.offset) == part.content:
            return None  # captured twice
        if pieces is None or part.offset in pieces.parts:  # numbers come again after 65,536 datagrams
            self._waiting.pop(part.key, None)
            pieces = self._waiting[part.key] = _Pieces(start)
            if len(self._waiting) > WAITING:
                del self._waiting[next(iter(self._waiting))]
        pieces.parts[part.offset] = part.content
        if not part.more:
            pieces.total = part.offset + len(part.content)
        if pieces.total is None or sum(map(len, pieces.parts.values())) < pieces.total:
            return None
        del self._waiting[part.key]
        whole = b"".join(pieces.parts[offset] for offset in sorted(pieces.parts))
        return whole, pieces.start


def udp_of(link: int, frame: bytes, start: int, together: Reassembly) -> Udp | None:
    """Return the datagram that a frame holds or completes; None if there is none, or if it was cut short.

    Args:
        link: Link type of the frame.
        frame: Its bytes.
        start: Its place in the file.
        together: Fragments of earlier frames.
    """
    try:
        part = _ip_part(link, frame)
        whole = None if part is None else together.add(part, start)
        if part is None or whole is None:
            return None
        content, first = whole
        _, port, size = struct.unpack_from(">HHH", content)
    except (struct.error, IndexError):
        return None
    size = size or len(content)  # 0: the network card would have filled it in
    if not 8 <= size <= len(content):
        return None
    return Udp((part.key[0], port), content[8:size], first)


def _ip_part(link: int, frame: bytes) -> _Part | None:
    at = _network_layer(link, frame)
    if at is None or at >= len(frame):
        return None
    match frame[at] >> 4:
        case 4:
            return _ipv4(frame, at)
        case 6:
            return _ipv6(frame, at)
    return None


def _network_layer(link: int, frame: bytes) -> int | None:
    """The place of the IP header in the frame; None if there is none."""
    if link in RAW:
        return 0
    if link in LOOPBACK:
        return 4
    at = {ETHERNET: 12, LINUX: 14, LINUX_2: 0}.get(link)
    if at is None:
        return None
    kind = struct.unpack_from(">H", frame, at)[0]
    if link == LINUX_2:
        return 20 if kind in (IPV4, IPV6) else None
    while kind in VLAN:
        at += 4
        kind = struct.unpack_from(">H", frame, at)[0]
    return at + 2 if kind in (IPV4, IPV6) else None


def _ipv4(frame: bytes, at: int) -> _Part | None:
    header = (frame[at] & 15) * 4
    total, number, place = struct.unpack_from(">HHH", frame, at + 2)
    if frame[at + 9] != UDP or header < 20:
        return None
    end = at + total if total else len(frame)
    key = (frame[at + 12 : at + 16], frame[at + 16 : at + 20], number)
    if end > len(frame) or end < at + header:
        return None  # cut short by the capture
    return _Part(key, (place & 0x1FFF) * 8, bool(place & 0x2000), frame[at + header : end])


def _ipv6(frame: bytes, at: int) -> _Part | None:
    length, kind = struct.unpack_from(">HB", frame, at + 4)
    end = at + 40 + length if length else len(frame)
    if end > len(frame):
        return None
    addresses = frame[at + 8 : at + 24], frame[at + 24 : at + 40]
    place, number, at = 0, 0, at + 40
    while kind in EXTENSIONS:
        kind, at = frame[at], at + 8 + 8 * frame[at + 1]
    if kind == FRAGMENT:
        kind = frame[at]
        place, number = struct.unpack_from(">HI", frame, at + 2)
        at += 8
    if kind != UDP:
        return None
    return _Part((*addresses, number), place & 0xFFF8, bool(place & 1), frame[at:end])
