from __future__ import annotations

import pytest

from slam.data.packets.sweeps import Arrival, sweeps_of, unwrapped

from .conftest import legacy_packet
from .test_ouster import metadata


@pytest.mark.parametrize(
    ("numbers", "counted"),
    [
        ([5, 5, 6, 7], [5, 5, 6, 7]),
        ([65534, 65535, 0, 1], [65534, 65535, 65536, 65537]),
        ([8, 9, 8, 9, 10], [8, 9, 8, 9, 10]),  # a packet came late
        ([0, 65535, 0, 1], [0, -1, 0, 1]),
        ([900, 901, 0, 1, 1, 2], [900, 901, 902, 903, 903, 904]),  # switched on anew
        ([3, 4, 5, 0, 1], [3, 4, 5, 6, 7]),  # and soon again
        ([3, 5], [3, 5]),  # a sweep was lost
        ([3, 30_000], [3, 4]),  # the recording paused
    ],
)
def test_numbers_count_on(numbers: list[int], counted: list[int]) -> None:
    assert list(map(unwrapped(1 << 16), numbers)) == counted


def test_sweeps_know_their_packets_places_and_times() -> None:
    from slam.data.packets.ouster import OusterDecoder

    packets = [legacy_packet(3, 0), legacy_packet(4, 0), legacy_packet(3, 16), b"imu", legacy_packet(4, 16)]
    arrivals = [Arrival(10.0 + at, packet, 100 * at, 100 * at + 100) for at, packet in enumerate(packets)]
    first, second = sweeps_of(arrivals, OusterDecoder(metadata()))
    assert (first.number, first.frame, first.start, first.end, first.packets) == (3, 3, 0, 300, 2)
    assert (second.number, second.start, second.end, second.packets) == (4, 100, 500, 2)
    assert second.seconds - first.seconds == pytest.approx(0.1, abs=1e-6)
    assert (first.arrival, second.arrival) == (10.0, 11.0)
