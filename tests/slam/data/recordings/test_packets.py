"""Packets of LiDARs in recordings: the same scans as from a capture of these packets."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data import se3
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.point_blocks import UnreadableError
from slam.data.recordings.container import CDR, ROS1
from slam.data.recordings.messages import type_store
from slam.data.recordings.packets import packet_message, velodyne_scan
from slam.data.recordings.writer import FORMS, RecordingWriter
from tests.slam.data.packets.conftest import (
    METADATA,
    START,
    column_time,
    ethernet,
    legacy_packet,
    vlp16_turns,
    write_capture,
)
from tests.slam.data.recordings.conftest import EPOCH, Event, clouds, mounting, nanoseconds

Record = Callable[..., Path]
DEFINITIONS = {
    "ouster_ros/msg/PacketMsg": "uint8[] buf\n",
    "velodyne_msgs/msg/VelodynePacket": "builtin_interfaces/Time stamp\nuint8[1206] data\n",
    "velodyne_msgs/msg/VelodyneScan": "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n",
}
LATE = 0.05  # s from a packet's first column to its recording
PLACES = [(sweep, first) for sweep in range(4) for first in (0, 16)]


def define(writer: RecordingWriter) -> None:
    from rosbags.typesys import get_types_from_msg

    for kind, definition in DEFINITIONS.items():
        if kind not in writer.types.fielddefs:
            writer.types.register(get_types_from_msg(definition, kind))


def ouster(
    places: Iterable[tuple[int, int]] = PLACES, space: str = "/ouster", tail: bytes = b"", **about: Any
) -> list[Event]:
    """Packets of 16 columns each, from (sweep, column) on."""

    def event(sweep: int, first: int) -> Event:
        at = column_time(sweep, first) / 1e9 - EPOCH + LATE

        def write(writer: RecordingWriter, recorded: int) -> None:
            define(writer)
            buf = np.frombuffer(legacy_packet(sweep, first, **about) + tail, np.uint8)
            message = writer.make("ouster_ros/msg/PacketMsg", buf=buf)
            writer.write(f"{space}/lidar_packets", recorded, message)

        return at, write

    return [event(*place) for place in places]


def metadata(topic: str = "/ouster/metadata", **changes: Any) -> Event:
    text = json.dumps(METADATA | changes)
    return 0.0, lambda writer, recorded: writer.write(topic, recorded, writer.make("std_msgs/msg/String", data=text))


def capture(path: Path) -> Any:
    """The same packets of an Ouster as a capture."""
    write_capture(path, [(column_time(*at) * 1e-9 + LATE, ethernet(legacy_packet(*at))) for at in PLACES])
    path.with_suffix(".json").write_text(json.dumps(METADATA))
    return open_dataset(path)


def same(data: Any, wanted: Any) -> None:
    assert len(data) == len(wanted)
    for position in range(len(data)):
        found, expected = data[position].cloud, wanted[position].cloud
        for name in ("xyz", "ring", "time", "intensity"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        assert data[position].problems == wanted[position].problems == ()


@pytest.mark.parametrize("form", FORMS)
def test_an_ousters_packets_are_the_scans_of_a_capture(record: Record, tmp_path: Path, form: str) -> None:
    data: Any = open_dataset(record([metadata(), *ouster()], form))
    (tmp_path / "capture").mkdir()
    same(data, capture(tmp_path / "capture" / "drive.pcap"))
    assert data.topics == {"points": "/ouster/lidar_packets"}
    assert (data.sensor.name, data.rings, data.problems) == ("OS-1-4", 4, ())
    np.testing.assert_allclose(data.stamps, START * 1e-9 + 0.1 * np.arange(4), atol=1e-6)
    assert data.stamps_from == "/ouster/lidar_packets, the sensor's clock"


def test_metadata_lie_beside_the_recording_or_are_named(record: Record, tmp_path: Path) -> None:
    path = record(ouster())
    with pytest.raises(InputError, match=r"place the \.json .* as drive\.json, or name it with --sensor FILE\.json"):
        open_dataset(path)
    (tmp_path / "elsewhere").mkdir()
    file = tmp_path / "elsewhere" / "os.json"
    file.write_text(json.dumps(METADATA))
    named: Any = open_dataset(path, sensor=file)
    assert (named.sensor.name, named[0].cloud.ring[:4].tolist()) == ("OS-1-4", [0, 1, 2, 3])
    file.rename(tmp_path / "os.json")
    same(open_dataset(path), named)


def test_metadata_of_another_lidar_are_not_taken(record: Record) -> None:
    other = metadata("/other/metadata", udp_profile_lidar="RNG15_RFL8_NIR8")
    path = record([other, metadata("/far/metadata"), *ouster()])
    assert len(open_dataset(path)) == 4
    with pytest.raises(InputError, match=r"/other/metadata: by it packets have 512 bytes, but most have 1088"):
        open_dataset(record([other, *ouster()], name="wrong"))


def test_older_drivers_append_a_byte(record: Record) -> None:
    whole = open_dataset(record([metadata(), *ouster()], name="whole"))
    same(open_dataset(record([metadata(), *ouster(tail=b"\0")])), whole)


def test_packets_of_an_imu_are_no_scans(record: Record) -> None:
    def imu(at: float) -> Event:
        def write(writer: RecordingWriter, recorded: int) -> None:
            define(writer)
            message = writer.make("ouster_ros/msg/PacketMsg", buf=np.zeros(48, np.uint8))
            writer.write("/ouster/imu_packets", recorded, message)

        return at, write

    data: Any = open_dataset(record([metadata(), *ouster(), *(imu(0.01 * at) for at in range(40))]))
    assert (data.topics["points"], data.problems) == ("/ouster/lidar_packets", ())


def test_point_clouds_come_before_packets_unless_the_topic_is_named(record: Record) -> None:
    path = record([*clouds(), metadata(), *ouster()])
    assert open_dataset(path).topics["points"] == "/velodyne_points"  # type: ignore[attr-defined]
    named: Any = open_dataset(path, topic="/ouster/lidar_packets")
    assert (named.topics["points"], len(named), named.sensor.name) == ("/ouster/lidar_packets", 4, "OS-1-4")


def test_of_several_lidars_one_is_taken_and_said(record: Record) -> None:
    rear = [metadata("/rear/metadata"), *ouster(space="/rear", millimetres=5000)]
    data: Any = open_dataset(record([metadata(), *ouster(PLACES[:6]), *rear]))
    assert data.topics["points"] == "/rear/lidar_packets"
    assert [problem.kind for problem in data.problems] == ["several topics"]
    assert "/ouster/lidar_packets (PacketMsg, 6)" in data.problems[0].message


@pytest.mark.parametrize("form", FORMS)
def test_lost_packets_are_told(record: Record, form: str) -> None:
    places = [place for place in PLACES if place != (2, 16)]
    data: Any = open_dataset(record([metadata(), *ouster(places)], form))
    assert [[problem.kind for problem in data[at].problems] for at in range(4)] == [[], [], ["lost packets"], []]
    assert len(data[2].cloud) == len(data[1].cloud) // 2
    gone: Any = open_dataset(record([metadata(), *ouster([place for place in PLACES if place[0] != 2])], form, "gone"))
    assert gone.numbers.tolist() == [0, 1, 3]
    assert [problem.kind for problem in gone.problems] == ["gap in numbering"]


def test_a_part_is_read_without_what_lies_before(record: Record) -> None:
    path = record([metadata(), *ouster()])
    whole: Any = open_dataset(path)
    part: Any = open_dataset(path, start=0.24, duration=0.19)
    assert len(part) == 2
    np.testing.assert_allclose(part.stamps, whole.stamps[2:], atol=1e-6)
    np.testing.assert_array_equal(part[0].cloud.xyz, whole[2].cloud.xyz)


def test_a_clock_that_counts_from_the_start_of_the_sensor_is_set(record: Record) -> None:
    data: Any = open_dataset(record([metadata(), *ouster(start=START - 5_000_000_000)]))
    np.testing.assert_allclose(data.stamps, START * 1e-9 + LATE + 0.1 * np.arange(4), atol=1e-4)
    assert "set by the recording machine's" in data.stamps_from
    assert data.problems == ()


def test_the_truth_is_that_of_the_lidars_frame(record: Record) -> None:
    T_base_lidar = se3.exp(np.array([0, 0, 0.5, 1.0, 0, 2.0]))

    def truth(at: float) -> Event:
        pose = se3.exp(at * np.array([0, 0, 0.2, 5, 0, 0]))
        return at, lambda writer, recorded: writer.write(
            "/gt", recorded, writer.odometry(recorded, "map", "base_link", pose)
        )

    events = [*mounting({("base_link", "os_sensor"): T_base_lidar}), *(truth(0.02 * at) for at in range(30))]
    data: Any = open_dataset(record([metadata(), *ouster(), *events]))
    assert data.problems == ()
    first, last = (se3.exp(at * np.array([0, 0, 0.2, 5, 0, 0])) @ T_base_lidar for at in (0.0, 0.3))
    np.testing.assert_allclose(data.ground_truth[3], se3.inverse(first) @ last, atol=1e-3)


@pytest.mark.parametrize("encoding", [ROS1, CDR])
def test_messages_that_are_cut_short_are_unreadable(encoding: str) -> None:
    writer = RecordingWriter(None, type_store(encoding == ROS1), ros1=encoding == ROS1)
    define(writer)
    make = writer.types.types["velodyne_msgs/msg/VelodynePacket"]
    packets = [make(stamp=writer.time(7), data=np.full(1206, at, np.uint8)) for at in range(3)]
    scan = writer.make("velodyne_msgs/msg/VelodyneScan", header=writer.header(1, "lidar"), packets=packets)
    single = writer.make("ouster_ros/msg/PacketMsg", buf=np.arange(64, dtype=np.uint8))
    serialize = writer.types.serialize_ros1 if encoding == ROS1 else writer.types.serialize_cdr
    for message, read, wanted in (
        (scan, velodyne_scan, [(7, bytes([at]) * 1206) for at in range(3)]),
        (single, packet_message, [(0, bytes(range(64)))]),
    ):
        content = bytes(serialize(message, message.__msgtype__))
        assert read(content, encoding) == wanted
        for size in (*range(0, 80), len(content) - 1209, len(content) - 4):
            if 0 <= size < len(content):
                with pytest.raises(UnreadableError):
                    read(content[:size], encoding)


def velodyne(packets: list[bytes], stamped: bool = True) -> list[Event]:
    """VelodyneScan messages of 70 packets each, which are no whole turns."""

    def event(first: int) -> Event:
        some = packets[first : first + 70]

        def write(writer: RecordingWriter, recorded: int) -> None:
            define(writer)
            make = writer.types.types["velodyne_msgs/msg/VelodynePacket"]
            times = [nanoseconds((first + at) / 750) if stamped else 0 for at in range(len(some))]
            made = [
                make(stamp=writer.time(time), data=np.frombuffer(each, np.uint8))
                for time, each in zip(times, some, strict=True)
            ]
            header = writer.header(times[-1], "velodyne")
            scan = writer.make("velodyne_msgs/msg/VelodyneScan", header=header, packets=made)
            writer.write("/velodyne_packets", recorded, scan)

        return (first + len(some)) / 750, write

    return [event(first) for first in range(0, len(packets), 70)]


@pytest.mark.parametrize("form", FORMS)
def test_a_velodynes_packets_are_the_scans_of_a_capture(record: Record, tmp_path: Path, form: str) -> None:
    pytest.importorskip("velodyne_decoder")
    packets = vlp16_turns(3.4, offset=18_000)
    folder = tmp_path / "capture"
    folder.mkdir()
    frames = [(EPOCH + at / 750, ethernet(packet)) for at, packet in enumerate(packets)]
    wanted: Any = open_dataset(write_capture(folder / "drive.pcap", frames))
    data: Any = open_dataset(record(velodyne(packets), form))
    same(data, wanted)
    np.testing.assert_allclose(data.stamps, wanted.stamps, atol=1e-5)
    assert (data.sensor.name, data.topics["points"]) == ("vlp16", "/velodyne_packets")
    assert [problem.kind for problem in data.problems] == ["cut sweep"]


def test_a_velodynes_packets_without_stamps(record: Record) -> None:
    pytest.importorskip("velodyne_decoder")
    data: Any = open_dataset(record(velodyne(vlp16_turns(3.4, offset=18_000), stamped=False)))
    assert len(data) == 3
    np.testing.assert_allclose(np.diff(data.stamps), 0.1, atol=0.002)


def test_packets_of_other_lidars_are_refused(record: Record) -> None:
    def event(at: float) -> Event:
        def write(writer: RecordingWriter, recorded: int) -> None:
            define(writer)
            buf = np.frombuffer(b"\xee\xff" + bytes(1002), np.uint8)
            writer.write("/hesai/packets", recorded, writer.make("ouster_ros/msg/PacketMsg", buf=buf))

        return at, write

    with pytest.raises(InputError, match="/hesai/packets: packets of a LiDAR by Hesai, which are not read"):
        open_dataset(record([event(0.1 * at) for at in range(3)]))
