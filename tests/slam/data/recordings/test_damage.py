"""Recordings that were cut off, lost their index or were damaged: what is whole is used, and said."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.recordings.messages import type_store
from slam.data.recordings.writer import FORMS, RecordingWriter
from tests.slam.data.recordings.conftest import SCANS, clouds, nanoseconds, sweep

Record = Callable[..., Path]


def long(count: int) -> list[Any]:
    """Scans that fill several chunks: each with 300 kB of padding in its points."""

    def event(number: int) -> Any:
        points = np.zeros(1000, [*((axis, "<f4") for axis in "xyz"), *((f"pad{at}", "<f8") for at in range(36))])
        points["x"], points["y"] = number + 1, np.linspace(1, 9, 1000)

        def write(writer: RecordingWriter, recorded: int) -> None:
            writer.write("/points", recorded, writer.cloud(recorded, "lidar", points))

        return 0.1 * number, write

    return [event(number) for number in range(count)]


def expect_whole(path: Path, least: int, most: int) -> Any:
    """The frames that are left are those of the beginning, and the recording says that it is damaged."""
    data: Any = open_dataset(path)
    assert least <= len(data) <= most
    assert "damaged recording" in [problem.kind for problem in data.problems]
    for number in range(len(data)):
        frame = data[number]
        assert frame.problems == ()
        assert frame.cloud.xyz[0, 0] == number + 1
    return data


@pytest.mark.parametrize(("form", "share"), [(form, share) for form in ("bag", "mcap") for share in (0.3, 0.55, 0.99)])
def test_cut_off_in_the_middle(record: Record, form: str, share: float) -> None:
    path = record(long(20), form)
    size = path.stat().st_size
    with path.open("ab") as file:
        file.truncate(round(share * size))
    expect_whole(path, int(20 * share) - 1, int(20 * share) + 1)


@pytest.mark.parametrize("share", [0.3, 0.55])
def test_a_database_cut_off_in_the_middle(record: Record, share: float) -> None:
    path = record(long(20), "ros2")
    with path.open("ab") as file:
        file.truncate(round(share * path.stat().st_size) // 4096 * 4096)
    data: Any = open_dataset(path)
    assert "damaged recording" in [problem.kind for problem in data.problems]
    whole = [number for number in range(len(data)) if not data[number].problems]
    assert len(whole) >= int(20 * share) - 2
    assert all(data[number].cloud.xyz[0, 0] == number + 1 for number in whole)
    lost = [number for number in range(len(data)) if data[number].problems]
    assert all(data[number].problems[0].kind == "missing scan" for number in lost)


def test_the_last_messages_of_a_database_lie_beside_it(record: Record) -> None:
    path = record(clouds(count=4), "ros2")
    recorder = sqlite3.connect(path)
    recorder.execute("PRAGMA journal_mode=WAL")
    recorder.execute("PRAGMA wal_autocheckpoint=0")
    with recorder:
        recorder.execute("INSERT INTO messages SELECT 100, topic_id, timestamp + 400000000, data FROM messages LIMIT 1")
    assert path.with_name(path.name + "-wal").stat().st_size > 0
    assert len(open_dataset(path)) == 5
    recorder.close()


def test_a_bag_that_was_never_closed(record: Record) -> None:
    path = record(long(8))
    content = bytearray(path.read_bytes())
    at = content.index(b"index_pos=") + len(b"index_pos=")
    (index,) = struct.unpack_from("<Q", content, at)
    content[at : at + 8] = bytes(8)
    path.write_bytes(content[:index])
    assert len(expect_whole(path, 8, 8)) == 8


def test_an_mcap_without_summary_is_read_from_its_chunks(record: Record) -> None:
    path = record(long(8), "mcap")
    content = path.read_bytes()
    at = content.index(bytes([0x0F]) + struct.pack("<Q", 4))
    path.write_bytes(content[:at])
    assert len(expect_whole(path, 8, 8)) == 8


def test_an_mcap_without_chunks(tmp_path: Path) -> None:
    """As rosbag2's fast writer leaves it: schema, channel and messages one after the other."""
    events, path = long(5), tmp_path / "bare.mcap"

    def record_of(op: int, content: bytes) -> bytes:
        return bytes([op]) + struct.pack("<Q", len(content)) + content

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    types, made = type_store(False), list[bytes]()

    class Noted:
        def add_connection(self, *_: object, **__: object) -> None: ...
        def write(self, _: object, recorded: int, data: memoryview) -> None:
            made.append(struct.pack("<HIQQ", 7, 0, recorded, recorded) + bytes(data))

    writer = RecordingWriter(Noted(), types, ros1=False)
    for at, event in events:
        event(writer, nanoseconds(at))
    schema = struct.pack("<H", 3) + text("sensor_msgs/msg/PointCloud2") + text("ros2msg") + text("")
    channel = struct.pack("<HH", 7, 3) + text("/points") + text("cdr") + struct.pack("<I", 0)
    header = record_of(1, text("") + text("test"))
    body = b"".join([header, record_of(3, schema), record_of(4, channel), *(record_of(5, each) for each in made)])
    ending = record_of(0x0F, bytes(4)) + record_of(2, bytes(20)) + b"\x89MCAP0\r\n"
    path.write_bytes(b"\x89MCAP0\r\n" + body + ending)
    data: Any = open_dataset(path)
    assert [problem.kind for problem in data.problems if problem.kind != "no point times"] == []
    assert [data[number].cloud.xyz[0, 0] for number in range(5)] == [1, 2, 3, 4, 5]
    path.write_bytes(b"\x89MCAP0\r\n" + body[:-1000])
    expect_whole(path, 4, 4)


@pytest.mark.parametrize("packing", ["BZ2", "LZ4"])
@pytest.mark.parametrize("share", [1.0, 0.7])
def test_packed_chunks_of_a_bag(tmp_path: Path, packing: str, share: float) -> None:
    path = tmp_path / "drive.bag"
    bag = Writer1(path)
    bag.set_compression(Writer1.CompressionFormat[packing])
    with bag:
        writer = RecordingWriter(bag, type_store(True), ros1=True)
        for at, event in long(12):
            event(writer, nanoseconds(at))
    if share < 1:
        with path.open("ab") as file:
            file.truncate(round(share * path.stat().st_size))
        expect_whole(path, 2, 11)
    else:
        data: Any = open_dataset(path)
        assert [data[number].cloud.xyz[0, 0] for number in range(12)] == list(range(1, 13))


@pytest.mark.parametrize(
    ("plugin", "mode"), [("MCAP", "STORAGE"), ("MCAP", "MESSAGE"), ("SQLITE3", "MESSAGE"), ("SQLITE3", "FILE")]
)
def test_packed_recordings_of_ros2(tmp_path: Path, plugin: str, mode: str) -> None:
    recording = Writer2(tmp_path / "drive", version=8, storage_plugin=StoragePlugin[plugin])
    recording.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with recording:
        writer = RecordingWriter(recording, type_store(False), ros1=False)
        for at, event in clouds():
            event(writer, nanoseconds(at))
    if mode == "FILE":
        with pytest.raises(InputError, match=r"drive\.db3\.zstd: packed as a whole; unpack it first: zstd -d"):
            open_dataset(tmp_path / "drive")
        return
    data: Any = open_dataset(tmp_path / "drive")
    assert data.problems == ()
    assert len(data) == SCANS
    np.testing.assert_array_equal(data[9].cloud.xyz[:, 0].max(), sweep(9).xyz[:, 0].max())


@pytest.mark.parametrize("form", FORMS)
def test_a_damaged_scan_is_a_problem_of_its_frame(record: Record, form: str) -> None:
    events = clouds()

    def broken(writer: RecordingWriter, recorded: int) -> None:
        message = writer.cloud(recorded - 5_000_000, "velodyne", np.zeros(5, [(axis, "<f4") for axis in "xyz"]))
        message.width = 500
        writer.write("/velodyne_points", recorded, message)

    events[4] = (events[4][0], broken)
    data: Any = open_dataset(record(events, form))
    assert len(data) == SCANS
    assert [problem.kind for problem in data[4].problems] == ["missing scan"]
    assert "/velodyne_points, message 4: cannot be read" in data[4].problems[0].message
    assert len(data[4].cloud) == 0
    assert data[5].problems == ()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("drive.bag", b"", "no ROS 1 bag"),
        ("drive.bag", b"#ROSBAG V1.2\n" + bytes(100), "no ROS 1 bag of format 2.0"),
        ("drive.mcap", b"RIFF" + bytes(100), "no MCAP file"),
        ("drive.db3", b"nothing", "no SQLite file"),
        ("drive.db3", b"SQLite format 3\0" + bytes(4000), "not a recording of ROS 2, or damaged"),
    ],
)
def test_files_that_are_no_recordings(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        open_dataset(tmp_path / name)


@pytest.mark.parametrize("form", FORMS)
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=8), value=st.integers(0, 255))
def test_whatever_is_damaged_nothing_but_input_errors(
    record: Record, form: str, where: list[float], value: int
) -> None:
    path = record(clouds("hesai", count=4), form)
    content = bytearray(path.read_bytes())
    for share in where:
        content[int(share * len(content))] = value
    path.write_bytes(content)
    try:
        data = open_dataset(path)
        for number in range(len(data)):
            data[number]
    except InputError:
        pass
