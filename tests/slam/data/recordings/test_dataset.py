"""Recordings as data sets: the same frames from every form, each driver's fields, topics, clocks, and parts of them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.recordings.recording import Recording
from slam.data.recordings.writer import FORMS, RecordingWriter
from tests.slam.data.recordings.conftest import EPOCH, SCANS, clouds, nanoseconds, sweep

Record = Callable[..., Path]


def opened(path: Path, **said: Any) -> Any:
    return open_dataset(path, **said)


def kinds(data: Any) -> list[str]:
    return [problem.kind for problem in data.problems]


@pytest.mark.parametrize("form", FORMS)
def test_the_frames_are_those_that_were_recorded(record: Record, form: str) -> None:
    data = opened(record(clouds(), form))
    assert len(data) == SCANS
    assert data.name == "drive"
    assert data.problems == ()
    np.testing.assert_array_equal(data.numbers, np.arange(SCANS))
    np.testing.assert_allclose(data.stamps, EPOCH + 0.1 * np.arange(1, SCANS + 1), atol=1e-6)
    for number in (0, 7):
        frame, scan = data[number], sweep(number)
        order = np.argsort(scan.fraction, kind="stable")
        assert frame.index == number
        assert frame.problems == ()
        assert frame.image is None
        np.testing.assert_array_equal(frame.cloud.xyz, scan.xyz[order])
        np.testing.assert_array_equal(frame.cloud.ring, scan.ring[order])
        np.testing.assert_allclose(frame.cloud.time, 0.1 * (scan.fraction[order] - 1), atol=1e-6)
        np.testing.assert_allclose(frame.cloud.intensity, scan.reflectance[order], atol=3e-3)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("driver", "field", "unit", "absolute", "stamp"),
    [
        ("velodyne", "time", "s", False, "end"),
        ("ouster", "t", "ns", False, "start"),
        ("hesai", "timestamp", "s", True, "start"),
        ("robosense", "timestamp", "s", True, "end"),
        ("livox", "offset_time", "ns", False, "start"),
    ],
)
def test_each_drivers_fields(
    record: Record, form: str, driver: str, field: str, unit: str, absolute: bool, stamp: str
) -> None:
    data = opened(record(clouds(driver), form))
    times = data.point_times
    assert (times.field, times.unit, times.absolute, times.stamp) == (field, unit, absolute, stamp)
    assert times.sweep == pytest.approx(0.1, rel=0.02)
    assert data.problems == ()
    frame, scan = data[3], sweep(3)
    assert frame.problems == ()
    assert len(frame.cloud) == len(scan.xyz)
    begin = {"start": 0.0, "end": -0.1}[stamp]
    key = np.lexsort(scan.xyz.T), np.lexsort(frame.cloud.xyz.T)
    np.testing.assert_array_equal(frame.cloud.xyz[key[1]], scan.xyz[key[0]])
    np.testing.assert_array_equal(frame.cloud.ring[key[1]], scan.ring[key[0]])
    np.testing.assert_allclose(frame.cloud.time[key[1]], begin + 0.1 * scan.fraction[key[0]], atol=1e-5)
    assert np.corrcoef(frame.cloud.intensity[key[1]], scan.reflectance[key[0]])[0, 1] > 0.99


def test_a_recording_of_ros2_is_its_folder_with_or_without_metadata(record: Record, tmp_path: Path) -> None:
    for form in ("ros2", "mcap"):
        file = record(clouds(), form, form)
        folder = tmp_path / f"{form}-folder"
        folder.mkdir()
        shutil.move(file, folder / file.name)
        without = opened(folder)
        shutil.move(tmp_path / "metadata.yaml", folder / "metadata.yaml")
        assert len(without) == len(opened(folder)) == SCANS
        assert without.name == folder.name


def test_parts_of_one_recording_follow_each_other(record: Record, tmp_path: Path) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    events = clouds()
    for part, some in enumerate((events[:4], events[4:])):
        shutil.move(record(some, "mcap", f"drive_{part}"), folder / f"drive_{9 + part}.mcap")
    data = opened(folder)
    np.testing.assert_array_equal(data[4].cloud.xyz[:, 0].max(), sweep(4).xyz[:, 0].max())
    assert len(data) == SCANS
    assert data.problems == ()
    (folder / "drive_11.mcap").touch()
    broken = opened(folder)
    assert len(broken) == SCANS
    assert kinds(broken) == ["damaged recording"]
    assert "drive_11.mcap: no MCAP file; what is whole is used" in broken.problems[0].message


def test_several_recordings_in_a_folder_are_sequences(record: Record, tmp_path: Path) -> None:
    folder = tmp_path / "many"
    folder.mkdir()
    for name in ("monday", "tuesday"):
        shutil.move(record(clouds(count=3 + len(name)), "bag", name), folder / f"{name}.bag")
    with pytest.raises(InputError, match=r"several sequences; name one with --sequence: monday\.bag, tuesday\.bag"):
        opened(folder)
    assert len(opened(folder, sequence="tuesday.bag")) == 10


def test_scans_in_a_folder_come_before_a_recording_beside_them(record: Record, tmp_path: Path) -> None:
    record(clouds(), "bag")
    np.save(tmp_path / "000000.npy", sweep(0).xyz)
    assert len(opened(tmp_path)) == 1


def test_of_two_topics_the_one_with_times_rings_and_points(record: Record) -> None:
    def plain(writer: RecordingWriter, recorded: int) -> None:
        points = np.zeros(5000, [(axis, "<f4") for axis in "xyz"])
        points["x"] = np.arange(1, 5001) / 1000
        writer.write("/filtered", recorded, writer.cloud(recorded, "map", points))

    path = record([*clouds(), *((0.1 * at, plain) for at in range(SCANS))], "mcap")
    data = opened(path)
    assert data.topics == {"points": "/velodyne_points"}
    assert kinds(data) == ["several topics"]
    for word in ("/filtered (PointCloud2, 10)", "/velodyne_points is used", "--topic chooses"):
        assert word in data.problems[0].message
    other = opened(path, topic="filtered")
    assert other.topics == {"points": "/filtered"}
    assert len(other[0].cloud) == 5000
    with pytest.raises(InputError, match=r"--topic /velodyne_point: no such topic; did you mean '/velodyne_points'\?"):
        opened(path, topic="/velodyne_point")


def test_maps_that_come_seldom_are_no_scans(record: Record) -> None:
    rare = [(at + 0.7, write) for at, write in clouds("hesai", topic="/map", count=2)]
    assert opened(record([*clouds(), *rare])).topics["points"] == "/velodyne_points"


def test_topics_are_listed_with_counts_and_rates(record: Record) -> None:
    topics = Recording(Path("drive"), [record(clouds())]).topics
    assert list(topics) == ["/velodyne_points"]
    topic = topics["/velodyne_points"]
    assert (topic.type, topic.count) == ("sensor_msgs/msg/PointCloud2", SCANS)
    assert topic.rate == pytest.approx(10, rel=1e-3)
    assert topic.first == pytest.approx(EPOCH + 0.105, abs=1e-6)


def test_no_clouds_but_packets(record: Record) -> None:
    def packet(writer: RecordingWriter, recorded: int) -> None:
        writer.write("/os/lidar_packets", recorded, writer.make("std_msgs/msg/String", data="raw"))

    with pytest.raises(InputError, match=r"no point clouds in it; /os/lidar_packets \(String, 1\) may be a LiDAR's"):
        opened(record([(0.0, packet)]))


def test_an_empty_recording(record: Record) -> None:
    with pytest.raises(InputError, match="no point clouds in it, nor anything else"):
        opened(record([], "mcap"))


@pytest.mark.parametrize("form", FORMS)
def test_stamps_are_the_headers_though_recorded_two_seconds_later(record: Record, form: str) -> None:
    data = opened(record(clouds(ahead=2.0), form))
    np.testing.assert_allclose(data.stamps, EPOCH + 0.1 * np.arange(1, SCANS + 1), atol=1e-6)
    assert kinds(data) == ["stamps of another clock"]
    assert "recorded 2.005 s after their stamps" in data.problems[0].message
    assert data.stamps_from == "/velodyne_points, headers"
    assert data.point_times.stamp == "end"


def test_without_stamps_in_headers_the_times_of_recording_count(record: Record) -> None:
    def cloud(writer: RecordingWriter, recorded: int) -> None:
        points = DRIVERLESS.copy()
        writer.write("/points", recorded, writer.cloud(0, "lidar", points))

    data = opened(record([(0.1 * at, cloud) for at in range(5)]))
    np.testing.assert_allclose(data.stamps, EPOCH + 0.1 * np.arange(5), atol=1e-6)
    assert "no time stamps" in kinds(data)
    assert data.stamps_from == "/points, times of recording"


DRIVERLESS = np.zeros(50, [(axis, "<f4") for axis in "xyz"])
DRIVERLESS["x"] = np.arange(1, 51)


def test_messages_recorded_out_of_order_are_put_in_order(record: Record) -> None:
    events = clouds()
    (early, write_early), (late, write_late) = events[4], events[5]
    events[4:6] = [(late + 0.01, write_early), (early, write_late)]
    data = opened(record(events))
    assert (np.diff(data.stamps) > 0.09).all()
    assert data.problems == ()
    np.testing.assert_array_equal(data[4].cloud.xyz[:, 0].max(), sweep(4).xyz[:, 0].max())


@pytest.mark.parametrize("form", FORMS)
def test_a_part_is_read_without_what_lies_before(record: Record, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = record(clouds(), form)
    read: list[int] = []
    whole = Recording.read

    def noted(self: Recording, topic: str, number: int, most: int | None = None) -> tuple[bytes, str]:
        read.append(number)
        return whole(self, topic, number, most)

    data = opened(path)
    monkeypatch.setattr(Recording, "read", noted)
    part = opened(path, start=0.35, duration=0.3, topic="/velodyne_points")
    frames = [part[position] for position in range(len(part))]
    assert [frame.index for frame in frames] == [4, 5, 6] == part.numbers.tolist()
    assert set(read) == {4, 5, 6}
    np.testing.assert_array_equal(frames[1].cloud.xyz, data[5].cloud.xyz)
    np.testing.assert_array_equal(part.stamps, data.stamps[4:7])


def test_a_part_that_is_not_there(record: Record) -> None:
    with pytest.raises(InputError, match=r"no scans there; its scans were recorded 0\.0 s to 0\.9 s after its start"):
        opened(record(clouds()), start=100.0)


@pytest.mark.parametrize("form", FORMS)
def test_any_thread_may_read_any_frame(record: Record, form: str) -> None:
    data = opened(record(clouds(), form))
    wanted = [data[number].cloud.xyz for number in range(SCANS)]
    with ThreadPoolExecutor(8) as pool:
        order = np.random.default_rng(0).integers(0, SCANS, 200).tolist()
        for number, found in zip(order, pool.map(lambda number: data[number].cloud.xyz, order), strict=True):
            np.testing.assert_array_equal(found, wanted[number])


def test_sensor_and_conventions_lie_beside_the_file(record: Record, tmp_path: Path) -> None:
    path = record(clouds())
    (tmp_path / "sensor.yaml").write_text("model: vlp16\nstamp: start\n")
    data = opened(path)
    assert data.sensor.name == "vlp16"
    assert data.point_times.stamp == "start"
    assert opened(path, stamp="middle").point_times.stamp == "middle"


def test_clouds_in_a_maps_frame_are_moved_once(record: Record) -> None:
    def cloud(writer: RecordingWriter, recorded: int) -> None:
        points = np.zeros(100, [(axis, "<f8") for axis in "xyz"])
        points["x"], points["y"] = 457000 + np.linspace(0, 20, 100) + recorded % 7, 5428000
        writer.write("/points", recorded, writer.cloud(recorded, "map", points))

    data = opened(record([(0.1 * at, cloud) for at in range(4)]))
    assert "map coordinates" in kinds(data)
    assert all(frame.problems == () and np.abs(frame.cloud.xyz).max() < 100 for frame in (data[0], data[3]))


def test_options_for_recordings_are_refused_elsewhere(tmp_path: Path) -> None:
    np.save(tmp_path / "000000.npy", sweep(0).xyz)
    with pytest.raises(InputError, match="--image-topic is not for this kind of data set"):
        opened(tmp_path, image_topic="/camera")


def test_nanoseconds_are_exact() -> None:
    assert nanoseconds(0.1) == 1_700_000_000_100_000_000
