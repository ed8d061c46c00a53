"""A drive in a packet capture, as a data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from ipaddress import ip_address
from itertools import islice
from pathlib import Path

import numpy as np

from slam.data.cloud import Array, Frame
from slam.data.errors import InputError
from slam.data.files import gaps
from slam.data.packets.ouster import OusterDecoder
from slam.data.packets.ouster_metadata import Metadata, read_metadata
from slam.data.packets.pcap import SUFFIXES, Capture, Datagram
from slam.data.packets.sweeps import Arrival, Decoder, Packet, Sweep, sweeps_of
from slam.data.packets.velodyne import VelodyneDecoder, is_velodyne
from slam.data.point_files import Points, points_of
from slam.data.problem import Problem
from slam.data.scan_columns import SAMPLES, Columns, find_columns
from slam.data.sensor import conventions_of_folder, nominal_lines, sensor_of_folder
from slam.data.stamps import mended, usual_step

LOOKED_AT = 2000  # datagrams, by which streams are told apart
WHOLE = 0.9  # of a sweep's usual packets; with fewer the first and the last count as cut off
EPOCH = 1e9  # s since 1970: a clock that shows less has not been set
#: What others begin their packets with, and how to get points of them.
OTHERS = {
    b"\xee\xff": ("Hesai", "PandarView or Hesai's driver for ROS"),
    b"\x55\xaa\x05\x0a": ("RoboSense", "RSView or rslidar_sdk"),
    b"\x55\xaa\x05\x5a": ("RoboSense", "RSView or rslidar_sdk"),
}
Stream = tuple[tuple[bytes, int], int]  # sender, and bytes of a datagram


class PacketSequence:
    """A .pcap or .pcapng file of a Velodyne, or of an Ouster with its metadata beside it (the .json file that Ouster's
    tools write with it). Of several LiDARs in it, that with the most packets is taken.

    Stamps are of the sensor's first column or firing, and go by its clock; one that shows no date is set by the
    recording machine's. See `Dataset` for the fields.

    Args:
        path: The file.
        sensor: An Ouster's metadata (.json); or overrides the laser lines, see `load_sensor`.
        stamp: The instant of a sweep that the stamps are said to belong to; by default what they are, its start.
        point_time: The field with the points' times, FIELD or FIELD:UNIT.

    Raises:
        InputError: The file is no capture, holds no packets that are understood, or the metadata are missing.
    """

    LAYOUT = "a packet capture (*.pcap, *.pcapng)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """The file itself, or the captures in a folder by their names. See `Loader`."""
        if path.suffix.lower() == ".osf":
            raise InputError(
                f"{path}: Ouster's .osf is not read; convert it: pip install ouster-sdk in an environment of its own, "
                f"then ouster-cli source {path.name} save {path.stem}.pcap"
            )
        if path.is_file():
            return {"": path} if path.suffix.lower() in SUFFIXES else {}
        return {file.stem: file for file in sorted(path.iterdir()) if _is_capture(file)}

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        self.path, self.name = path, path.stem
        self._capture = Capture(path)
        self._stream, others = self._most_packets()
        metadata = sensor if sensor is not None and Path(sensor).suffix.lower() == ".json" else None
        override = None if metadata else sensor
        self._decoder = self._decoder_for(None if metadata is None else Path(metadata))
        self.sensor = sensor_of_folder(path.parent, override, self._decoder.sensor)
        self._sweeps, cut = _whole_ones(sweeps_of(self._arrivals(), self._decoder), path)
        self._usual = int(np.median([sweep.packets for sweep in self._sweeps]))
        self.numbers = np.array([sweep.number - self._sweeps[0].number for sweep in self._sweeps])
        self.stamps, self.stamps_from, unusual = self._stamps()
        said = conventions_of_folder(path.parent, override).said(stamp, point_time)
        first = [(self.points(at), float(self.stamps[at])) for at in range(min(len(self), SAMPLES))]
        columns = find_columns(first, self.sensor, said, usual_step(self.stamps), path)
        self._columns = self._known_rings(columns)
        self.point_times, self.rings = self._columns.times, self._columns.rings
        self.calibration = self.ground_truth = None
        missing = gaps(self.numbers, path)
        nominal = nominal_lines(self.sensor, path)
        self.problems = (*others, *nominal, *cut, *missing, *unusual, *self._columns.problems)

    def __len__(self) -> int:
        return len(self._sweeps)

    def __getitem__(self, position: int) -> Frame:
        points, stamp = self.points(position), float(self.stamps[position])
        cloud, odd = self._columns.cloud(points, stamp, self.path)
        return Frame(int(self.numbers[position]), stamp, cloud, problems=(*points.problems, *odd))

    def _arrivals(self, start: int = 0, end: int | None = None) -> Iterator[Arrival]:
        """The packets of the stream that is taken."""
        for found in self._capture.datagrams(start, end):
            if _stream(found) == self._stream:
                yield Arrival(found.stamp, found.payload, found.start, found.end)

    def _most_packets(self) -> tuple[Stream, tuple[Problem, ...]]:
        """The stream of which the file has the most packets, and what is said of others like it."""
        looked = list(islice(self._capture.datagrams(), LOOKED_AT))
        if not looked:
            raise InputError(f"{self.path}: no whole UDP datagrams in it; record the LiDAR's packets afresh")
        counted = Counter(map(_stream, looked))
        # Packets with points are by far the most bytes; IMU and position packets come as often, but are small.
        stream = max(counted, key=lambda found: counted[found] * found[1])
        likewise = [sender for sender, size in counted if size == stream[1] and sender != stream[0]]
        if not likewise:
            return stream, ()
        senders = ", ".join(map(_named, likewise))
        text = f"{self.path}: several LiDARs; that at {_named(stream[0])} is taken, not {senders}"
        return stream, (Problem("several LiDARs", text),)

    def _decoder_for(self, metadata: Path | None) -> Decoder:
        first = next(self._arrivals()).payload
        if is_velodyne(first):
            return VelodyneDecoder((arrival.payload for arrival in self._arrivals()), self.path)
        for head, (maker, tool) in OTHERS.items():
            if first.startswith(head):
                raise InputError(
                    f"{self.path}: packets of a LiDAR by {maker}, which are not read; save points as .pcd files or in "
                    f"a ROS bag with {tool}"
                )
        return OusterDecoder(self._metadata(metadata, first))

    def _metadata(self, said: Path | None, payload: bytes) -> Metadata:
        """That the user names, or that lies beside the recording and fits a packet of it."""
        if said is not None:
            metadata = read_metadata(said)
            if fault := metadata.misfit(payload):
                raise InputError(f"{said}: {fault} in {self.path}; name the metadata of this recording")
            return metadata
        files = sorted(self.path.parent.glob("*.json"), key=lambda file: (not file.stem.startswith(self.name), file))
        faults = []
        for file in files:
            try:
                metadata = read_metadata(file)
            except InputError as error:
                if file.stem.startswith(self.name):
                    faults.append(str(error))
                continue
            fault = metadata.misfit(payload)
            if not fault:
                return metadata
            faults.append(f"{file}: {fault}")
        why = f" ({'; '.join(faults)})" if faults else ""
        raise InputError(
            f"{self.path}: packets of {len(payload)} bytes that only an Ouster's metadata explain{why}; place the "
            f".json file that was recorded with it beside it as {self.name}.json, or name it with --sensor FILE.json"
        )

    def _stamps(self) -> tuple[Array, str, tuple[Problem, ...]]:
        """Stamps (N,) [s], where they are from, and what is wrong with them."""
        seconds = np.array([sweep.seconds for sweep in self._sweeps])
        arrival = np.array([sweep.arrival for sweep in self._sweeps])
        seconds[~np.isfinite(seconds)] = np.nan
        where = "the sensor's clock"
        if not np.isfinite(seconds).any():
            seconds, where = arrival, "when packets were captured"
        elif np.nanmedian(seconds) < EPOCH and np.median(arrival) >= EPOCH:
            seconds = seconds + np.nanmin(arrival - seconds)
            where = "the sensor's clock, set by the recording machine's"
        stamps, problems = mended(seconds, self.path)
        return stamps, where, problems

    def _known_rings(self, columns: Columns) -> Columns:
        """An Ouster's rings need no guess, unless its lines are overridden."""
        sensor = self._decoder.sensor
        if isinstance(self._decoder, OusterDecoder) and sensor is not None and self.sensor is sensor:
            return replace(columns, ring_of=np.arange(sensor.ring_count))
        return columns

    def recorded(self, position: int) -> Array:
        """The points of a sweep as its decoder has them: a structured array, see `Decoder.points`."""
        return self._decoder.points(self._packets(position))

    def _packets(self, position: int) -> list[Packet]:
        sweep = self._sweeps[position]
        found = self._arrivals(sweep.start, sweep.end)
        return [(one.stamp, one.payload) for one in found if self._decoder.frame_of(one.payload) == sweep.frame]

    def points(self, position: int) -> Points:
        """A scan as its packets have it."""
        packets = self._packets(position)
        points = points_of(self._decoder.points(packets), self.path)
        if len(packets) >= WHOLE * self._usual:
            return points
        text = (
            f"{self.path}: scan {self.numbers[position]} has {len(packets)} of {self._usual} packets; the rest was lost"
        )
        return replace(points, problems=(*points.problems, Problem("lost packets", text)))


def _is_capture(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def _named(sender: tuple[bytes, int]) -> str:
    address, port = sender
    return f"{ip_address(address)}, port {port}"


def _stream(found: Datagram) -> Stream:
    return found.sender, len(found.payload)


def _whole_ones(sweeps: list[Sweep], path: Path) -> tuple[list[Sweep], tuple[Problem, ...]]:
    """The sweeps without a first and a last one that the recording cuts off."""
    if not sweeps:
        raise InputError(f"{path}: no packets with points in it; record the LiDAR's packets afresh")
    enough = WHOLE * float(np.median([sweep.packets for sweep in sweeps]))
    kept = list(sweeps)
    if len(kept) > 2 and kept[0].packets < enough:
        kept = kept[1:]
    if len(kept) > 1 and kept[-1].packets < enough:
        kept = kept[:-1]
    if len(kept) == len(sweeps):
        return kept, ()
    text = f"{path}: begins or ends within a sweep; what is there of that is left out"
    return kept, (Problem("cut sweep", text),)
