from __future__ import annotations

import io
import struct
from pathlib import Path

import dpkt
import pytest

from slam.data.errors import InputError
from slam.data.packets.network import Reassembly, udp_of
from slam.data.packets.pcap import Capture

from .conftest import ethernet, fragments, write_capture


@pytest.mark.parametrize("name", ["a.pcap", "a.pcapng"])
def test_datagrams_come_with_stamp_and_sender(tmp_path: Path, name: str) -> None:
    path = write_capture(tmp_path / name, [(100.25, ethernet(b"first")), (101.5, ethernet(b"second", port=2368))])
    first, second = Capture(path).datagrams()
    assert (first.payload, first.sender) == (b"first", (b"\x0a\x00\x00\x01", 7502))
    assert (second.payload, second.sender) == (b"second", (b"\x0a\x00\x00\x01", 2368))
    assert [first.stamp, second.stamp] == pytest.approx([100.25, 101.5], abs=1e-5)


@pytest.mark.parametrize("name", ["a.pcap", "a.pcapng"])
def test_a_part_of_the_file_gives_its_datagrams(tmp_path: Path, name: str) -> None:
    capture = Capture(write_capture(tmp_path / name, [(at, ethernet(bytes([at] * 9))) for at in range(6)]))
    every = list(capture.datagrams())
    assert list(capture.datagrams(every[2].start, every[3].end)) == every[2:4]


@pytest.mark.parametrize("name", ["a.pcap", "a.pcapng"])
def test_a_file_that_was_cut_off_gives_what_is_whole(tmp_path: Path, name: str) -> None:
    path = write_capture(tmp_path / name, [(at, ethernet(bytes([at] * 200))) for at in range(3)])
    whole = path.read_bytes()
    ends = [found.end for found in Capture(path).datagrams()]
    for length in range(24 if name == "a.pcap" else 60, len(whole)):
        path.write_bytes(whole[:length])
        assert len(list(Capture(path).datagrams())) == sum(end <= length for end in ends)


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 0, 0, 1, 2]])
def test_fragments_are_put_together_in_any_order(tmp_path: Path, order: list[int]) -> None:
    payload = bytes(range(256)) * 16
    parts = fragments(payload, number=7)
    assert len(parts) == 3
    path = write_capture(tmp_path / "a.pcap", [(at, parts[which]) for at, which in enumerate(order)])
    (found,) = Capture(path).datagrams()
    assert found.payload == payload
    assert list(Capture(path).datagrams(found.start, found.end)) == [found]


def test_a_lost_fragment_loses_its_datagram_alone(tmp_path: Path) -> None:
    first, second = (fragments(bytes([at]) * 4000, number=3) for at in (1, 2))  # the number came again
    path = write_capture(tmp_path / "a.pcap", [(0, part) for part in (*first[:2], *second)])
    assert [found.payload for found in Capture(path).datagrams()] == [b"\x02" * 4000]


def _ip(payload: bytes) -> bytes:
    return ethernet(payload)[14:]


def _ipv6(payload: bytes) -> bytes:
    udp = struct.pack(">HHHH", 7502, 7502, 8 + len(payload), 0) + payload
    return struct.pack(">IHBB", 6 << 28, 8 + len(udp), 0, 64) + bytes(16) * 2 + bytes([17, 0] + [0] * 6) + udp


@pytest.mark.parametrize(
    ("link", "frame"),
    [
        (1, bytes(12) + b"\x81\x00\x00\x05\x08\x00" + _ip(b"content")),  # VLAN
        (1, bytes(12) + b"\x86\xdd" + _ipv6(b"content")),
        (1, ethernet(b"content") + bytes(11)),  # padded to Ethernet's least
        (101, _ip(b"content")),
        (113, bytes(14) + b"\x08\x00" + _ip(b"content")),
        (276, b"\x08\x00" + bytes(18) + _ip(b"content")),
        (0, bytes(4) + _ip(b"content")),
    ],
)
def test_frames_of_other_networks(link: int, frame: bytes) -> None:
    found = udp_of(link, frame, 0, Reassembly())
    assert found is not None
    assert found.payload == b"content"


@pytest.mark.parametrize(
    "frame",
    [b"", bytes(13), bytes(12) + b"\x08\x06" + bytes(28), ethernet(b"content")[:-3], bytes(12) + b"\x08\x00\x45"],
)
def test_what_is_no_whole_datagram_is_passed_over(frame: bytes) -> None:
    assert udp_of(1, frame, 0, Reassembly()) is None


def test_stamps_of_nanoseconds_and_either_byte_order(tmp_path: Path) -> None:
    frame = ethernet(b"x")
    for order in "<>":
        head = struct.pack(order + "IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 1)
        record = struct.pack(order + "IIII", 7, 250_000_000, len(frame), len(frame)) + frame
        path = tmp_path / "a.pcap"
        path.write_bytes(head + record)
        (found,) = Capture(path).datagrams()
        assert found.stamp == pytest.approx(7.25)


def test_what_is_no_capture_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    for content in (b"", b"PK\x03\x04" * 20, b"\xd4\xc3\xb2\xa1"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"a\.pcap: no packet capture"):
            Capture(path)
    with pytest.raises(InputError, match="cannot be read"):
        Capture(tmp_path / "none.pcap")


def test_a_record_that_says_too_much_ends_the_reading(tmp_path: Path) -> None:
    out = io.BytesIO()
    dpkt.pcap.Writer(out).writepkt(ethernet(b"x"), 1.0)
    path = tmp_path / "a.pcap"
    path.write_bytes(out.getvalue() + struct.pack("<IIII", 2, 0, 1 << 31, 1 << 31) + bytes(5000))
    assert len(list(Capture(path).datagrams())) == 1
