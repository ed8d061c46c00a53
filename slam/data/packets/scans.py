"""The scans of one LiDAR in a stream of its packets."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.files import gaps
from slam.data.packets.ouster import OusterDecoder
from slam.data.packets.sweeps import Arrival, Decoder, Packet, Sweep, sweeps_of
from slam.data.point_files import Points, points_of
from slam.data.problem import Problem
from slam.data.scan_columns import Columns
from slam.data.sensor import Sensor
from slam.data.stamps import mended

WHOLE = 0.9  # of a sweep's usual packets; with fewer the first and the last count as cut off
EPOCH = 1e9  # s since 1970: a clock that shows less has not been set


class PacketScans:
    """Sweeps as scans: all packets are looked at once, then each sweep is read without the others.

    Args:
        arrivals: Iterates over the LiDAR's packets whose places are from `start` to before `end` (None: all).
        decoder: Decoder of these packets.
        where: The recording, for messages.

    Attributes:
        numbers: (N,) int64, numbers of the scans, from 0; a lost sweep leaves a gap.
        stamps: (N,) float64 [s], of the first column or firing of each scan.
        stamps_from: The clock of the stamps.
        arrivals_s: (N,) float64 [s], arrival of the first packet of each scan by the recording machine's clock.
        problems: Cut and lost sweeps, and what is wrong with the stamps.

    Raises:
        InputError: There are no packets with points.
    """

    def __init__(self, arrivals: Callable[[int, int | None], Iterable[Arrival]], decoder: Decoder, where: Path) -> None:
        self._arrivals, self._decoder, self._where = arrivals, decoder, where
        self._sweeps, cut = _whole_ones(sweeps_of(arrivals(0, None), decoder), where)
        self._usual = int(np.median([sweep.packets for sweep in self._sweeps]))
        self.numbers = np.array([sweep.number - self._sweeps[0].number for sweep in self._sweeps])
        self.arrivals_s = np.array([sweep.arrival for sweep in self._sweeps])
        self.stamps, self.stamps_from, unusual = self._stamps()
        self.problems = (*cut, *unusual, *gaps(self.numbers, where))

    def __len__(self) -> int:
        return len(self._sweeps)

    def _stamps(self) -> tuple[Array, str, tuple[Problem, ...]]:
        """Stamps (N,) [s], their source, and what is wrong with them."""
        seconds = np.array([sweep.seconds for sweep in self._sweeps])
        seconds[~np.isfinite(seconds)] = np.nan
        source = "the sensor's clock"
        if not np.isfinite(seconds).any():
            seconds, source = self.arrivals_s, "when packets were captured"
        elif np.nanmedian(seconds) < EPOCH and np.median(self.arrivals_s) >= EPOCH:
            seconds = seconds + np.nanmin(self.arrivals_s - seconds)
            source = "the sensor's clock, set by the recording machine's"
        stamps, problems = mended(seconds, self._where)
        return stamps, source, problems

    def with_known_rings(self, columns: Columns, sensor: Sensor | None) -> Columns:
        """Return the columns with an Ouster's rings as its decoder numbers them, unless its lines are overridden."""
        own = self._decoder.sensor
        if isinstance(self._decoder, OusterDecoder) and own is not None and sensor is own:
            return replace(columns, ring_of=np.arange(own.ring_count))
        return columns

    def recorded(self, position: int) -> Array:
        """Return the points of a scan as its decoder has them: a structured array, see `Decoder.points`."""
        return self._decoder.points(self._packets(position))

    def points(self, position: int) -> Points:
        """Return the points of a scan; lost packets are a Problem."""
        packets = self._packets(position)
        points = points_of(self._decoder.points(packets), self._where)
        if len(packets) >= WHOLE * self._usual:
            return points
        lost = f"scan {self.numbers[position]} has {len(packets)} of {self._usual} packets; the rest was lost"
        return replace(points, problems=(*points.problems, Problem("lost packets", f"{self._where}: {lost}")))

    def _packets(self, position: int) -> list[Packet]:
        sweep = self._sweeps[position]
        found = self._arrivals(sweep.start, sweep.end)
        return [(one.stamp, one.payload) for one in found if self._decoder.frame_of(one.payload) == sweep.frame]


def _whole_ones(sweeps: list[Sweep], where: Path) -> tuple[list[Sweep], tuple[Problem, ...]]:
    """The sweeps without a first and a last one that the recording cuts off."""
    if not sweeps:
        raise InputError(f"{where}: no packets with points in it; record the LiDAR's packets afresh")
    enough = WHOLE * float(np.median([sweep.packets for sweep in sweeps]))
    kept = list(sweeps)
    if len(kept) > 2 and kept[0].packets < enough:
        kept = kept[1:]
    if len(kept) > 1 and kept[-1].packets < enough:
        kept = kept[:-1]
    if len(kept) == len(sweeps):
        return kept, ()
    text = f"{where}: begins or ends within a sweep; what is there of that is left out"
    return kept, (Problem("cut sweep", text),)
