"""Packets put together to sweeps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.sensor import Sensor

LATE, PAUSE = 2, 100  # sweeps: where numbers go farther back or on, the sensor or the recording began anew

#: When a packet came, seconds of the recording machine's clock, and its bytes.
Packet = tuple[float, bytes]


class Place(NamedTuple):
    """Which sweep a packet belongs to.

    Attributes:
        number: The sweep's, counting on through the recording.
        frame: What packets of this sweep have in common, by which `Decoder.frame_of` knows them.
        seconds: When its first points were seen, by the sensor's clock; NaN where it has none.
    """

    number: int
    frame: int
    seconds: float


class Decoder(Protocol):
    """What turns the packets of one kind of LiDAR into points.

    Attributes:
        name: The LiDAR's, for people.
        sensor: Its laser lines, None where they are not known.
    """

    name: str

    @property
    def sensor(self) -> Sensor | None: ...

    def frame_of(self, payload: bytes) -> int | None:
        """What all packets of a sweep have in common; None where this is no packet with points."""
        ...

    def placing(self) -> Callable[[bytes], Place | None]:
        """A function that is shown all packets in their order, and tells where each belongs; None as `frame_of`."""
        ...

    def points(self, packets: Sequence[Packet]) -> Array:
        """The points of a sweep, from its packets: a structured array (N,) with x, y, z [m] and, by names that
        `points_of` knows, intensity, ring and time from the sweep's first point on."""
        ...


class Arrival(NamedTuple):
    """A packet as it is found: its bytes, when it came [s], and where it is in the file."""

    stamp: float
    payload: bytes
    start: int
    end: int


@dataclass
class Sweep:
    """Where in the file the packets of a sweep are.

    Attributes:
        number: Counting on through the recording.
        frame: By which its packets are known (`Decoder.frame_of`).
        start: Where the first begins, and
        end: where the last one ends.
        seconds: When its first points were seen, by the sensor's clock, infinite where that is not known.
        arrival: When its first packet came [s].
        packets: How many there are.
    """

    number: int
    frame: int
    start: int
    end: int
    seconds: float
    arrival: float
    packets: int = 0


def sweeps_of(arrivals: Iterable[Arrival], decoder: Decoder) -> list[Sweep]:
    """The sweeps in a recording, in their order; packets that came late count to theirs."""
    place, found = decoder.placing(), dict[int, Sweep]()
    for stamp, payload, start, end in arrivals:
        where = place(payload)
        if where is None:
            continue
        sweep = found.get(where.number)
        if sweep is None:
            sweep = found[where.number] = Sweep(where.number, where.frame, start, end, np.inf, stamp)
        sweep.start, sweep.end = min(sweep.start, start), max(sweep.end, end)
        sweep.packets += 1
        if where.seconds < sweep.seconds:
            sweep.seconds = where.seconds
    return [found[number] for number in sorted(found)]


def unwrapped(modulus: int) -> Callable[[int], int]:
    """A function that counts on where the numbers it is given begin anew after `modulus`, and goes back a little for
    packets that came late. Where they jump farther the next number follows: stamps tell the pause."""
    last: int | None = None
    highest = shift = 0

    def count(number: int) -> int:
        nonlocal last, highest, shift
        if last is None:
            last = highest = number
            return number
        step = (number + shift - last + modulus // 2) % modulus - modulus // 2
        if not -LATE <= step <= PAUSE:
            shift = highest + 1 - number
            step = highest + 1 - last
        last += step
        highest = max(highest, last)
        return last

    return count
