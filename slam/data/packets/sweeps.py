"""Assembly of packets into sweeps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.sensor import Sensor

LATE, PAUSE = 2, 100  # sweeps: after a larger step back or ahead, the sensor or the recording was restarted

#: Arrival of a packet by the recording machine's clock [s], and its bytes.
Packet = tuple[float, bytes]


class Place(NamedTuple):
    """The sweep of a packet.

    Attributes:
        number: Number of the sweep, increasing through the recording.
        frame: The sweep's number in its packets, as `Decoder.frame_of` returns it.
        seconds: Time of the packet's first points by the sensor's clock [s]; NaN if unknown.
    """

    number: int
    frame: int
    seconds: float


class Decoder(Protocol):
    """Decoder of the packets of one LiDAR.

    Attributes:
        name: Name of the LiDAR, for people.
    """

    name: str

    @property
    def sensor(self) -> Sensor | None:
        """The laser lines, None if they are unknown."""
        ...

    def frame_of(self, payload: bytes) -> int | None:
        """Return the number that all packets of a sweep have; None if this is no packet with points."""
        ...

    def placing(self) -> Callable[[bytes], Place | None]:
        """Return a function that assigns packets, given in their order, to sweeps; it returns None as `frame_of`."""
        ...

    def points(self, packets: Sequence[Packet]) -> Array:
        """Return the points of a sweep.

        Returns:
            A structured array (N,) with x, y, z [m] and, by names that `points_of` knows, intensity, ring and the time
            since the sweep's first point.
        """
        ...


class Arrival(NamedTuple):
    """A packet in a recording.

    Attributes:
        stamp: Arrival by the recording machine's clock [s].
        payload: Its bytes.
        start: Its place in the recording.
        end: The place after it.
    """

    stamp: float
    payload: bytes
    start: int
    end: int


@dataclass
class Sweep:
    """Places of the packets of a sweep in a recording.

    Attributes:
        number: Number of the sweep, increasing through the recording.
        frame: The sweep's number in its packets (`Decoder.frame_of`).
        start: Place of the first packet.
        end: Place after the last packet.
        seconds: Time of its first points by the sensor's clock [s]; infinite if unknown.
        arrival: Arrival of its first packet [s].
        packets: Number of packets.
    """

    number: int
    frame: int
    start: int
    end: int
    seconds: float
    arrival: float
    packets: int = 0


def sweeps_of(arrivals: Iterable[Arrival], decoder: Decoder) -> list[Sweep]:
    """Find the sweeps in a recording, in their order; late packets belong to their own sweep."""
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
    """Return a function that unwraps numbers which restart at `modulus`.

    Late packets get the numbers of their sweeps. After a jump of more than `PAUSE` ahead, or `LATE` back, the next
    number follows: the stamps tell the pause.
    """
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
