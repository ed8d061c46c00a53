"""A recording as topics whose messages are read one by one; one file, or several that it was split into."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.point_blocks import UnreadableError
from slam.data.problem import Problem
from slam.data.recordings.clouds import CLOUDS
from slam.data.recordings.container import Channel, Container, Series
from slam.data.recordings.mcap import Mcap
from slam.data.recordings.messages import (
    CAMERA_INFO,
    COMPRESSED,
    FIX,
    HEAD,
    IMAGE,
    IMU,
    ODOMETRY,
    OLD_TRANSFORMS,
    PATH,
    POSE,
    POSE_WITH_COVARIANCE,
    STRING,
    TRANSFORMS,
    Header,
    header_of,
    read_message,
)
from slam.data.recordings.packets import PACKETS
from slam.data.recordings.rosbag1 import Rosbag1
from slam.data.recordings.sqlite import Sqlite

CONTAINERS: dict[str, Callable[[Path, Collection[str]], Container]] = {".bag": Rosbag1, ".db3": Sqlite, ".mcap": Mcap}
PACKED = (".zstd", ".zst")  # suffixes of files that rosbag2 has compressed as a whole
TRUTH_TYPES = (ODOMETRY, POSE, POSE_WITH_COVARIANCE, PATH)
#: Use of all messages of a type.
USES = {IMU: "IMU, not used", FIX: "GNSS, not used", TRANSFORMS: "mounting", OLD_TRANSFORMS: "mounting"}
#: Types whose messages can be read one by one; messages of other types are only counted.
READ = frozenset(
    (*CLOUDS, *PACKETS, STRING, IMAGE, COMPRESSED, CAMERA_INFO, *TRUTH_TYPES, FIX, TRANSFORMS, OLD_TRANSFORMS)
)


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one name.

    Attributes:
        name: Name of the topic.
        type: Type of its messages, as ROS 2 writes it.
        count: Number of messages.
        first: When the first was recorded [s].
        last: When the last was recorded [s].
        longest_step: Longest time between successive messages [s].
    """

    name: str
    type: str
    count: int
    first: float
    last: float
    longest_step: float = 0.0

    @property
    def rate(self) -> float:
        """Messages per second; 0 for a single one."""
        return (self.count - 1) / (self.last - self.first) if self.count > 1 and self.last > self.first else 0.0

    def __str__(self) -> str:
        return f"{self.name} ({self.type.rpartition('/')[2]}, {self.count})"


class Recording:
    """Messages by topic and number, in the order in which they were recorded.

    Args:
        path: The file, or the folder of the files, for messages.
        files: The files that the recording was split into, in their order.

    Attributes:
        problems: Damaged files.

    Raises:
        InputError: None of the files is a recording.
    """

    def __init__(self, path: Path, files: Sequence[Path]) -> None:
        self.path = path
        self._files: list[Container] = []
        faults = []
        for file in files:
            try:
                self._files.append(_opened(file))
            except InputError as error:  # the last part of a recording that broke off may be empty
                faults.append(str(error))
        if not self._files:
            raise InputError(faults[0])
        faults += [f"{file.path}: {file.fault}" for file in self._files if file.fault]
        self.problems = tuple(Problem("damaged recording", f"{fault}; what is whole is used") for fault in faults)

    @cached_property
    def topics(self) -> dict[str, Topic]:
        """The topics by name, sorted. Of a name with messages of two types, the type with more messages counts."""
        found: dict[str, list[tuple[Channel, Series]]] = {}
        for file in self._files:
            for number, channel in file.channels.items():
                series = file.series.get(number)
                if series is not None and series.count:
                    found.setdefault(channel.topic, []).append((channel, series))
        return {name: _summed(name, found[name]) for name in sorted(found)}

    def of_type(self, *types: str) -> list[Topic]:
        """Return the topics whose messages are of one of these types."""
        return [topic for topic in self.topics.values() if topic.type in types]

    def times(self, topic: str) -> Array:
        """Return when each of a topic's N messages was recorded, (N,) int64 [ns]."""
        return self._places(topic)[:, 0]

    def read(self, topic: str, number: int, most: int | None = None) -> tuple[bytes, str]:
        """Read the bytes of a message.

        Args:
            topic: Name of the topic.
            number: Number of the message in it.
            most: Number of bytes at its beginning that suffice, None for all.

        Returns:
            The bytes, and their encoding, `ROS1` or `CDR`.

        Raises:
            UnreadableError: The message is damaged.
        """
        _, file, block, offset, channel = self._places(topic)[number]
        container = self._files[file]
        try:
            return container.read(int(block), int(offset), most), container.channels[int(channel)].encoding
        except OSError as error:
            raise UnreadableError(str(error.strerror or error)) from error

    def message(self, topic: str, number: int) -> Any:
        """Read a message as an object.

        Raises:
            UnreadableError: The message is damaged.
        """
        content, encoding = self.read(topic, number)
        return read_message(content, self.topics[topic].type, encoding)

    def header(self, topic: str, number: int) -> Header | None:
        """Read the header of a message whose type has one; None if it is damaged."""
        try:
            content, encoding = self.read(topic, number, HEAD)
            return header_of(content, encoding)
        except UnreadableError:
            return None

    def messages(self, topic: str) -> Iterator[Any]:
        """Iterate over the messages that can be read."""
        for number in range(len(self._places(topic))):
            try:
                yield self.message(topic, number)
            except UnreadableError:
                continue

    def _places(self, topic: str) -> Array:
        """The index of a topic, (N, 5) int64: time [ns], file, block, offset, channel."""
        if topic not in self._tables:
            self._tables[topic] = self._table(topic)
        return self._tables[topic]

    @cached_property
    def _tables(self) -> dict[str, Array]:
        return {}

    def _table(self, topic: str) -> Array:
        parts = [np.zeros((0, 5), np.int64)]
        for at, file in enumerate(self._files):
            for number, channel in file.channels.items():
                if channel.topic == topic and channel.type == self.topics[topic].type and number in file.series:
                    rows = file.series[number].rows
                    ones = np.ones(len(rows), np.int64)
                    parts.append(np.column_stack([rows[:, 0], at * ones, rows[:, 1:], number * ones]))
        table = np.concatenate(parts)
        return table[np.argsort(table[:, 0], kind="stable")]


def _summed(name: str, entries: list[tuple[Channel, Series]]) -> Topic:
    counts: dict[str, int] = {}
    for channel, series in entries:
        counts[channel.type] = counts.get(channel.type, 0) + series.count
    kind = max(counts, key=lambda each: counts[each])
    known = sorted((series for channel, series in entries if channel.type == kind), key=lambda each: each.first)
    between = [later.first - earlier.last for earlier, later in pairwise(known)]
    first, last = known[0].first, max(series.last for series in known)
    longest = max(*(series.longest for series in known), *between, 0)
    return Topic(name, kind, counts[kind], first / 10**9, last / 10**9, longest / 10**9)


def _opened(path: Path) -> Container:
    try:
        return CONTAINERS[path.suffix.lower()](path, READ)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (UnreadableError, sqlite3.Error) as error:
        raise InputError(f"{path}: {error}") from error


def recordings_at(path: Path) -> dict[str, list[Path]]:
    """Find the recordings at a path.

    A file is one, and so is a folder with one file, or with the files that rosbag2 has split one into (drive_0.mcap,
    drive_1.mcap). In any other folder, each file is one.

    Returns:
        The files of each recording by its name, '' for the only one.

    Raises:
        InputError: A file is compressed as a whole.
    """
    if path.is_file():
        return {"": [path]} if path.suffix.lower() in CONTAINERS or _packed(path) else {}
    if not path.is_dir():
        return {}
    files = [file for file in path.iterdir() if not file.name.startswith(".")]
    found = sorted((file for file in files if file.suffix.lower() in CONTAINERS), key=_part)
    if not found:
        for file in files:
            _packed(file)
        return {}
    split = all(file.suffix.lower() != ".bag" for file in found) and len({_part(file)[0] for file in found}) == 1
    return {"": found} if split or len(found) == 1 else {file.name: [file] for file in found}


def _packed(path: Path) -> bool:
    """Raises InputError if a file of a recording is compressed as a whole."""
    if path.suffix.lower() in PACKED and Path(path.stem).suffix.lower() in CONTAINERS:
        raise InputError(f"{path}: packed as a whole; unpack it first: zstd -d {path.name}")
    return False


def _part(file: Path) -> tuple[str, int]:
    """The name of the recording that a file of rosbag2 belongs to, and the file's number in it."""
    name, underscore, number = file.stem.rpartition("_")
    return (name, int(number)) if underscore and number.isdigit() else (file.stem, -1)
