"""A drive in a packet capture, as a data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from ipaddress import ip_address
from itertools import islice
from pathlib import Path

from slam.data.cloud import Array, Frame
from slam.data.errors import InputError
from slam.data.packets.decoders import decoder_for, metadata_beside, metadata_file
from slam.data.packets.pcap import SUFFIXES, Capture, Datagram
from slam.data.packets.scans import PacketScans
from slam.data.packets.sweeps import Arrival
from slam.data.point_files import Points
from slam.data.problem import Problem
from slam.data.scan_columns import SAMPLES, find_columns
from slam.data.sensor import conventions_of_folder, sensor_of_folder
from slam.data.stamps import usual_step

LOOKED_AT = 2000  # datagrams by which streams are told apart
Stream = tuple[tuple[bytes, int], int]  # sender, and bytes of a datagram


class PacketSequence:
    """A packet capture of a Velodyne, or of an Ouster with its metadata beside it.

    The metadata are the .json file that Ouster's tools write with a recording. If several LiDARs are in a capture, the
    one with the most packets is used. Stamps are of the sensor's first column or firing, by its clock; a clock that
    shows no date is set by that of the recording machine. See `Dataset` for the attributes.

    Args:
        path: The file.
        sensor: An Ouster's metadata (.json); or overrides the laser lines, see `load_sensor`.
        stamp: The instant of a sweep that the stamps belong to; by default its start, where they are.
        point_time: The field with the points' times, FIELD or FIELD:UNIT.

    Raises:
        InputError: The file is no capture, holds no packets that are understood, or the metadata are missing.
    """

    LAYOUT = "a packet capture (*.pcap, *.pcapng)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Return the file itself, or the captures in a folder by their names. See `Loader`.

        Raises:
            InputError: The file is an .osf, which has to be converted.
        """
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
        said = metadata_file(sensor)
        override = None if said else sensor
        decoder = decoder_for(
            lambda: (arrival.payload for arrival in self._arrivals(0, None)),
            lambda payload: metadata_beside(path.parent, self.name, payload, path, said),
            path,
        )
        self.sensor = sensor_of_folder(path.parent, override, decoder.sensor)
        self._scans = PacketScans(self._arrivals, decoder, path)
        self.numbers, self.stamps, self.stamps_from = self._scans.numbers, self._scans.stamps, self._scans.stamps_from
        conventions = conventions_of_folder(path.parent, override).said(stamp, point_time)
        first = [(self.points(at), float(self.stamps[at])) for at in range(min(len(self), SAMPLES))]
        columns = find_columns(first, self.sensor, conventions, usual_step(self.stamps), path)
        self._columns = self._scans.with_known_rings(columns, self.sensor)
        self.point_times, self.rings = self._columns.times, self._columns.rings
        self.calibration = self.ground_truth = None
        self.problems = (*others, *self._scans.problems, *self._columns.problems)

    def __len__(self) -> int:
        return len(self._scans)

    def __getitem__(self, position: int) -> Frame:
        points, stamp = self.points(position), float(self.stamps[position])
        cloud, odd = self._columns.cloud(points, stamp, self.path)
        return Frame(int(self.numbers[position]), stamp, cloud, problems=(*points.problems, *odd))

    def points(self, position: int) -> Points:
        """Return a scan as its packets have it."""
        return self._scans.points(position)

    def recorded(self, position: int) -> Array:
        """Return a scan as its decoder has it, a structured array; see `Decoder.points`."""
        return self._scans.recorded(position)

    def _arrivals(self, start: int, end: int | None) -> Iterator[Arrival]:
        """The packets of the stream that is taken."""
        for found in self._capture.datagrams(start, end):
            if _stream(found) == self._stream:
                yield Arrival(found.stamp, found.payload, found.start, found.end)

    def _most_packets(self) -> tuple[Stream, tuple[Problem, ...]]:
        """The stream with the most packets in the file, and a Problem if there are others of its kind."""
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


def _is_capture(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def _named(sender: tuple[bytes, int]) -> str:
    address, port = sender
    return f"{ip_address(address)}, port {port}"


def _stream(found: Datagram) -> Stream:
    return found.sender, len(found.payload)
