"""The scans of a recording's topic: a point cloud in each message, or the sweeps of a LiDAR's packets."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.packets.decoders import decoder_for, metadata_beside
from slam.data.packets.ouster_metadata import Metadata, parse_metadata
from slam.data.packets.scans import PacketScans
from slam.data.packets.sweeps import Arrival
from slam.data.point_blocks import UnreadableError
from slam.data.point_files import Points, points_of
from slam.data.problem import Problem
from slam.data.recordings.clock import Stamped, stamped
from slam.data.recordings.clouds import CLOUDS
from slam.data.recordings.messages import STRING, VELODYNE_SCAN
from slam.data.recordings.packets import PACKETS
from slam.data.recordings.recording import Recording, Topic
from slam.data.scan_columns import Columns
from slam.data.sensor import Sensor
from slam.data.sound_points import Offset

SHUFFLED = 1.0  # s that messages may have been recorded out of their order
WITHIN = 1 << 16  # places of packets within a message: packet k of message m is at m * WITHIN + k
OUSTER_FRAME = re.compile(r"(^|[/_])os\d?_sensor$")


class TopicScans(Protocol):
    """The scans of a topic.

    Attributes:
        found: Their numbers, stamps and frame.
        stamps_from: Source of the stamps.
        sensor: The LiDAR's laser lines as the recording has them, None if it does not.
        problems: What is wrong with the topic as a whole.
    """

    found: Stamped
    stamps_from: str
    sensor: Sensor | None
    problems: tuple[Problem, ...]

    def points(self, position: int, offset: Offset | None) -> Points:
        """Read a scan, moved by `offset` (see `points_of`); damage is a Problem."""
        ...

    def with_known_rings(self, columns: Columns, sensor: Sensor | None) -> Columns:
        """Return the columns with the rings that the recording numbers, unless `sensor` is another LiDAR."""
        ...


class MessageScans:
    """Messages each of which is a scan: PointCloud2, or CustomMsg of Livox. See `TopicScans`.

    Args:
        recording: The recording.
        topic: One whose type is in `CLOUDS`.
        chosen: (M,) int64, numbers of the messages that are used.
    """

    sensor: Sensor | None = None
    problems: tuple[Problem, ...] = ()

    def __init__(self, recording: Recording, topic: Topic, chosen: Array) -> None:
        self._recording, self._topic = recording, topic
        self.found = _in_order(stamped(recording, topic.name, chosen))
        self.stamps_from = f"{topic.name}, {'headers' if self.found.by_header else 'times of recording'}"

    def points(self, position: int, offset: Offset | None) -> Points:
        """See `TopicScans`."""
        number = int(self.found.numbers[position])
        name = Path(f"{self._recording.path}: {self._topic.name}, message {number}")
        try:
            content, encoding = self._recording.read(self._topic.name, number)
            return points_of(CLOUDS[self._topic.type](content, encoding), name, offset)
        except (UnreadableError, InputError) as error:
            text = str(error).removeprefix(f"{name}: ")
            problem = Problem("missing scan", f"{name}: cannot be read ({text}); no points used")
            return Points(np.zeros((0, 3), np.float32), problems=(problem,))

    def with_known_rings(self, columns: Columns, sensor: Sensor | None) -> Columns:
        """See `TopicScans`."""
        return columns


class PacketTopicScans:
    """Sweeps of a Velodyne or an Ouster out of its packets. See `TopicScans`.

    An Ouster's metadata are those that the user names, else those of a topic `metadata` in the packets' name space,
    else those of a .json file beside the recording.

    Args:
        recording: The recording.
        topic: One whose type is in `PACKETS`.
        chosen: (M,) int64, numbers of the messages that are used, increasing.
        folder: Folder of the recording.
        metadata: The file with an Ouster's metadata that the user names.
        frames: Frames of the recording, one of which may be an Ouster's, whose packets name none.

    Raises:
        InputError: The packets are not understood, or an Ouster's metadata are missing.
    """

    def __init__(
        self,
        recording: Recording,
        topic: Topic,
        chosen: Array,
        folder: Path,
        metadata: Path | None,
        frames: set[str],
    ) -> None:
        self._recording, self._topic = recording, topic
        self._first, self._last = int(chosen[0]), int(chosen[-1])
        where = Path(f"{recording.path}: {topic.name}")
        decoder = decoder_for(self._payloads, partial(self._metadata, folder, metadata), where)
        self._scans = PacketScans(self._arrivals, decoder, where)
        self.sensor, self.problems = decoder.sensor, self._scans.problems
        self.stamps_from = f"{topic.name}, {self._scans.stamps_from}"
        lag = float(np.median(self._scans.arrivals_s - self._scans.stamps))
        self.found = Stamped(self._scans.numbers, self._scans.stamps, lag, True, self._frame(frames))

    def points(self, position: int, offset: Offset | None) -> Points:
        """See `TopicScans`."""
        return self._scans.points(position)

    def with_known_rings(self, columns: Columns, sensor: Sensor | None) -> Columns:
        """See `TopicScans`."""
        return self._scans.with_known_rings(columns, sensor)

    def _arrivals(self, start: int, end: int | None) -> Iterator[Arrival]:
        """The packets at places from `start` to before `end`; those of unreadable messages are lost."""
        first = max(start // WITHIN, self._first)
        last = self._last if end is None else min((end - 1) // WITHIN, self._last)
        times = self._recording.times(self._topic.name)
        for message in range(first, last + 1):
            try:
                packets = PACKETS[self._topic.type](*self._recording.read(self._topic.name, message))
            except UnreadableError:
                continue
            for at, (time, payload) in enumerate(packets, message * WITHIN):
                if at >= start and (end is None or at < end):
                    yield Arrival((time or int(times[message])) / 10**9, payload, at, at + 1)

    def _payloads(self) -> Iterator[bytes]:
        return (arrival.payload for arrival in self._arrivals(0, None))

    def _frame(self, frames: set[str]) -> str:
        """The frame of the points."""
        if self._topic.type == VELODYNE_SCAN:
            header = self._recording.header(self._topic.name, self._first)
            return "" if header is None else header.frame
        found = [frame for frame in frames if OUSTER_FRAME.search(frame)]
        return found[0] if len(found) == 1 else ""

    def _metadata(self, folder: Path, said: Path | None, payload: bytes) -> Metadata:
        """The metadata that fit a packet."""
        faults = []
        for topic, text in self._metadata_texts() if said is None else ():
            try:
                metadata = parse_metadata(text, f"{self._recording.path}: {topic}")
            except InputError as error:
                faults.append(str(error))
                continue
            if not (fault := metadata.misfit(payload)):
                return metadata
            faults.append(f"{self._recording.path}: {topic}: {fault}")
        try:
            return metadata_beside(folder, self._recording.path.stem, payload, self._recording.path, said)
        except InputError as error:
            raise InputError("; ".join([*faults, str(error)])) from error

    def _metadata_texts(self) -> Iterator[tuple[str, str]]:
        """Topic and content of the messages that may be metadata, those of the packets' name space first."""
        space = self._topic.name.rpartition("/")[0]
        known = [topic for topic in self._recording.of_type(STRING) if topic.name.endswith("metadata")]
        for topic in sorted(known, key=lambda topic: topic.name.rpartition("/")[0] != space):
            for message in self._recording.messages(topic.name):
                yield topic.name, message.data


def packet_bytes(recording: Recording, topic: Topic) -> int:
    """Return how many bytes of packets a topic has, by its first readable message; those of an IMU are few."""
    for message in range(topic.count):
        try:
            packets = PACKETS[topic.type](*recording.read(topic.name, message))
        except UnreadableError:
            continue
        return topic.count * sum(len(payload) for _, payload in packets)
    return 0


def _in_order(found: Stamped) -> Stamped:
    """Messages by their stamps where they were recorded a little out of order, as networks deliver them."""
    order = np.argsort(found.stamps, kind="stable")
    known = np.isfinite(found.stamps).all()
    late = np.maximum.accumulate(found.stamps) - found.stamps if known else np.zeros(1)
    if not known or late.max() == 0 or late.max() > SHUFFLED:
        return found
    return Stamped(found.numbers[order], found.stamps[order], found.lag, found.by_header, found.frame)
