"""UDP datagrams of a packet capture, .pcap or .pcapng, as tcpdump, Wireshark and the makers' tools write it.

Libraries return neither the places of datagrams in the file, by which one sweep is read without the others, nor
datagrams reassembled from IP fragments. Therefore captures are read here.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from slam.data.errors import InputError
from slam.data.packets.network import Reassembly, udp_of

SUFFIXES = (".pcap", ".pcapng", ".cap")
LARGEST = 1 << 20  # bytes of a packet; a larger size is damage
SECTION, INTERFACE, SIMPLE, ENHANCED = 0x0A0D0D0A, 1, 3, 6  # blocks of pcapng
#: Of classic captures, as their first bytes: byte order, and parts of a second.
MAGIC = {
    b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6),
    b"\xa1\xb2\x3c\x4d": (">", 1e-9),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9),
}


class Datagram(NamedTuple):
    """A UDP datagram.

    Attributes:
        stamp: Time of capture [s since 1970].
        sender: Address of the sender and port of the receiver, which distinguish streams.
        payload: Its bytes.
        start: Place of its first record in the file.
        end: Place after its last record.
    """

    stamp: float
    sender: tuple[bytes, int]
    payload: bytes
    start: int
    end: int


class Interface(NamedTuple):
    """An interface of a capture: link type (tcpdump's LINKTYPE), unit of the stamps [s], and their offset [s]."""

    link: int
    unit: float
    offset: float


class Record(NamedTuple):
    """A frame of the network at places `begin` to `stop` of the file, in a record from `start` to `end`."""

    stamp: float
    link: int
    begin: int
    stop: int
    start: int
    end: int


class Capture:
    """A capture file; it is not kept in memory, and may be read from any thread.

    Attributes:
        path: The file.

    Raises:
        InputError: It is no capture, or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with path.open("rb") as file:
                head = file.read(24)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
        self._classic = head[:4] in MAGIC and len(head) == 24
        if not self._classic and (head[:4] != SECTION.to_bytes(4, "big") or len(head) < 12):
            raise InputError(f"{path}: no packet capture (.pcap, .pcapng), or nothing in it; record it afresh")
        self._sections: dict[int, list[Interface]] = {}  # by where they begin, as far as read

    def datagrams(self, start: int = 0, end: int | None = None) -> Iterator[Datagram]:
        """Iterate over the complete datagrams in the file's order, of a truncated file those before the cut.

        Args:
            start: Place of the first record; other than 0 only after all of the file has been read.
            end: Place before which records begin, None for the end of the file.
        """
        with self.path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            records = self._records_classic(data, start) if self._classic else self._records_next(data, start)
            together = Reassembly()
            for record in records:
                if end is not None and record.start >= end:
                    break
                found = udp_of(record.link, data[record.begin : record.stop], record.start, together)
                if found is not None:
                    yield Datagram(record.stamp, found.sender, found.payload, found.start, record.end)

    def _records_classic(self, data: mmap.mmap, start: int) -> Iterator[Record]:
        order, unit = MAGIC[data[:4]]
        link = struct.unpack_from(order + "I", data, 20)[0] & 0xFFFFFFF
        header = struct.Struct(order + "IIII")
        at = max(start, 24)
        while at + 16 <= len(data):
            seconds, parts, size, _ = header.unpack_from(data, at)
            begin, stop = at + 16, at + 16 + size
            if size > LARGEST or stop > len(data):
                return
            yield Record(seconds + parts * unit, link, begin, stop, at, stop)
            at = stop

    def _records_next(self, data: mmap.mmap, start: int) -> Iterator[Record]:
        at = max((place for place in self._sections if place <= start), default=0)
        if start and at in self._sections:
            order, interfaces = _byte_order(data, at), self._sections[at].copy()
            at = max(start, at)
        while at + 12 <= len(data):
            kind = data[at : at + 4]
            if kind == SECTION.to_bytes(4, "big"):  # reads the same in either byte order
                order, interfaces = _byte_order(data, at), []
                self._sections.setdefault(at, interfaces)
            kind, size = struct.unpack_from(order + "II", data, at)
            end = at + size
            if size < 12 or size % 4 or size > LARGEST or end > len(data):
                return
            if kind == INTERFACE and size >= 20:
                interfaces.append(_interface(data, at, end, order))
            elif kind in (ENHANCED, SIMPLE):
                record = _record(data, at, end, order, interfaces, kind)
                if record is not None:
                    yield record
            at = end


def _byte_order(data: mmap.mmap, at: int) -> str:
    return "<" if data[at + 8 : at + 12] == b"\x4d\x3c\x2b\x1a" else ">"


def _interface(data: mmap.mmap, at: int, end: int, order: str) -> Interface:
    """Link type, and of the options the resolution (9) and the offset (14) of stamps."""
    link, unit, offset = struct.unpack_from(order + "H", data, at + 8)[0], 1e-6, 0.0
    place = at + 16
    while place + 4 <= end - 4:
        code, length = struct.unpack_from(order + "HH", data, place)
        if code == 0:
            break
        if code == 9 and length == 1:
            power = data[place + 4]
            unit = 2.0 ** -(power & 0x7F) if power & 0x80 else 10.0**-power
        elif code == 14 and length == 8:
            offset = float(struct.unpack_from(order + "q", data, place + 4)[0])
        place += 4 + length + -length % 4
    return Interface(link, unit, offset)


def _record(data: mmap.mmap, at: int, end: int, order: str, interfaces: list[Interface], kind: int) -> Record | None:
    """The frame in a block of a packet; None where it is damaged."""
    if kind == SIMPLE:
        which, stamp, begin = 0, 0, at + 12
        size = min(struct.unpack_from(order + "I", data, at + 8)[0], end - 4 - begin)
    else:
        if end - at < 32:
            return None
        which, high, low, size = struct.unpack_from(order + "IIII", data, at + 8)
        stamp, begin = high << 32 | low, at + 28
    if which >= len(interfaces) or size < 0 or begin + size > end - 4:
        return None
    link, unit, offset = interfaces[which]
    return Record(stamp * unit + offset, link, begin, begin + size, at, end)
