from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError

from .conftest import METADATA, START, column_time, ethernet, fragments, legacy_packet, vlp16_turns, write_capture

Maker = Callable[..., Path]


def kinds(problems: object) -> list[str]:
    return [problem.kind for problem in problems]  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["drive.pcap", "drive.pcapng"])
def test_an_ouster_drive(ouster_drive: Maker, name: str) -> None:
    data = open_dataset(ouster_drive(name=name))
    assert (len(data), data.name, data.problems) == (4, "drive", ())
    assert data.sensor is not None
    assert (data.sensor.name, data.sensor.ring_count) == ("OS-1-4", 4)
    np.testing.assert_allclose(data.stamps, START * 1e-9 + 0.1 * np.arange(4), atol=1e-6)
    frame = data[2]
    assert (frame.index, len(frame.cloud), frame.problems) == (2, 128, ())
    assert frame.cloud.ring is not None
    assert frame.cloud.time is not None
    assert frame.cloud.ring[:5].tolist() == [0, 1, 2, 3, 0]
    np.testing.assert_allclose(frame.cloud.time, np.repeat(np.arange(32) * 0.003125, 4), atol=1e-6)
    assert frame.cloud.intensity[3] == pytest.approx(3 / 255)


def test_a_folder_of_captures(ouster_drive: Maker) -> None:
    path = ouster_drive()
    assert open_dataset(path.parent).path == path
    (path.parent / "other.pcap").write_bytes(path.read_bytes())
    with pytest.raises(InputError, match="several sequences; name one with --sequence: drive, other"):
        open_dataset(path.parent)
    assert open_dataset(path.parent, "other").name == "other"


def test_missing_metadata_are_asked_for(ouster_drive: Maker) -> None:
    path = ouster_drive()
    elsewhere = path.parent / "elsewhere"
    elsewhere.mkdir()
    path.with_suffix(".json").rename(elsewhere / "m.json")
    with pytest.raises(InputError, match=r"drive\.json, or name it with --sensor FILE\.json"):
        open_dataset(path)
    assert open_dataset(path, sensor=elsewhere / "m.json").sensor is not None
    wrong = METADATA | {"udp_profile_lidar": "RNG15_RFL8_NIR8"}
    (elsewhere / "m.json").write_text(json.dumps(wrong))
    with pytest.raises(InputError, match=r"by it packets have 512 bytes, but most have 1088 in "):
        open_dataset(path, sensor=elsewhere / "m.json")
    path.with_suffix(".json").write_text("{")
    with pytest.raises(InputError, match=r"drive\.json: no JSON"):
        open_dataset(path)


def test_osf_is_refused_with_the_command_that_converts_it(tmp_path: Path) -> None:
    path = tmp_path / "drive.osf"
    path.write_bytes(b"x")
    with pytest.raises(InputError, match=r"ouster-cli source drive\.osf save drive\.pcap"):
        open_dataset(path)


def test_sweeps_that_the_recording_cuts_are_left_out(ouster_drive: Maker) -> None:
    path = ouster_drive(2)
    packets = [(1, 16), (2, 0), (2, 16), (3, 0), (3, 16), (4, 0)]
    write_capture(path, [(0.1 * at, ethernet(legacy_packet(*where))) for at, where in enumerate(packets)])
    data = open_dataset(path)
    assert (len(data), kinds(data.problems)) == (2, ["cut sweep"])
    assert len(data[0].cloud) == 128


def test_lost_packets_and_sweeps_are_told(ouster_drive: Maker) -> None:
    path = ouster_drive(2)
    packets = [(1, 0), (1, 16), (2, 0), (2, 16), (3, 16), (5, 0), (5, 16), (6, 0), (6, 16)]
    write_capture(path, [(0.1 * at, ethernet(legacy_packet(*where))) for at, where in enumerate(packets)])
    data = open_dataset(path)
    assert (data.numbers.tolist(), kinds(data.problems)) == ([0, 1, 2, 4, 5], ["gap in numbering"])
    assert [kinds(data[at].problems) for at in range(5)] == [[], [], ["lost packets"], [], []]
    assert len(data[2].cloud) == 64


def test_fragmented_packets_and_packets_of_an_imu(ouster_drive: Maker) -> None:
    path = ouster_drive(3)
    whole = open_dataset(path)[1].cloud.xyz
    frames = []
    for sweep in range(3):
        for first in (0, 16):
            parts = fragments(legacy_packet(sweep, first), number=2 * sweep + first // 16, size=400)
            frames += [(0.0, part) for part in (*parts, *[ethernet(bytes(48), port=7503)] * 3)]
    write_capture(path, frames)
    data = open_dataset(path)
    assert (len(data), data.problems) == (3, ())
    assert np.array_equal(data[1].cloud.xyz, whole)


def test_a_clock_that_counts_from_the_start_of_the_sensor_is_set(ouster_drive: Maker) -> None:
    path = ouster_drive(2)
    packets = [(sweep, first) for sweep in range(3) for first in (0, 16)]
    delay = [0.03, 0.02, 0.01, 0.05, 0.02, 0.02]
    frames = []
    for (sweep, first), late in zip(packets, delay, strict=True):
        packet = legacy_packet(sweep, first, start=START - 5_000_000_000)
        frames.append((column_time(sweep, first) * 1e-9 + late, ethernet(packet)))
    write_capture(path, frames)
    data = open_dataset(path)
    np.testing.assert_allclose(data.stamps, START * 1e-9 + 0.01 + 0.1 * np.arange(3), atol=1e-5)
    assert "set by the recording machine's" in data.stamps_from  # type: ignore[attr-defined]


def test_of_several_lidars_one_is_taken_and_said(ouster_drive: Maker) -> None:
    path = ouster_drive(2)
    frames = []
    for sweep in range(3):
        for first in (0, 16):
            frames.append((0.0, ethernet(legacy_packet(sweep, first, 5000))))
            if sweep < 2:
                frames.append((0.0, ethernet(legacy_packet(sweep, first, 9000), source=b"\x0a\x00\x00\x09")))
    data = open_dataset(write_capture(path, frames))
    assert kinds(data.problems) == ["several LiDARs"]
    assert "10.0.0.9, port 7502" in data.problems[0].message
    assert np.linalg.norm(data[0].cloud.xyz, axis=1).max() < 6


@pytest.mark.parametrize(
    ("payload", "fault"),
    [
        (b"\xee\xff" + bytes(1000), "by Hesai"),
        (b"\x55\xaa\x05\x5a" + bytes(1244), "by RoboSense"),
        (b"x" * 99, "99 bytes"),
    ],
    ids=["hesai", "robosense", "unknown"],
)
def test_other_packets_are_refused(tmp_path: Path, payload: bytes, fault: str) -> None:
    path = write_capture(tmp_path / "drive.pcap", [(at, ethernet(payload)) for at in range(5)])
    with pytest.raises(InputError, match=fault):
        open_dataset(path)


def test_a_capture_without_datagrams_is_refused(tmp_path: Path) -> None:
    path = write_capture(tmp_path / "drive.pcap", [(0.0, b"\x00" * 60)])
    with pytest.raises(InputError, match="no whole UDP datagrams"):
        open_dataset(path)


def test_a_velodyne_drive(tmp_path: Path) -> None:
    pytest.importorskip("velodyne_decoder")
    packets = vlp16_turns(3.4, offset=18_000)  # begins as the head passes the rear
    path = write_capture(tmp_path / "drive.pcap", [(1e9 + at / 750, ethernet(p)) for at, p in enumerate(packets)])
    data = open_dataset(path)
    assert data.sensor is not None
    assert (data.sensor.name, len(data), kinds(data.problems)) == ("vlp16", 3, ["cut sweep"])
    np.testing.assert_allclose(np.diff(data.stamps), 0.1, atol=0.002)
    cloud = data[1].cloud
    assert cloud.ring is not None
    assert cloud.time is not None
    assert len(cloud) == 75 * 384
    assert np.linalg.norm(cloud.xyz, axis=1) == pytest.approx(10, abs=0.05)
    rho = np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1])
    elevation = np.rad2deg(np.arctan2(cloud.xyz[:, 2], rho))
    np.testing.assert_allclose(elevation, 15 - 2 * cloud.ring, atol=0.2)
    assert cloud.time[0] == pytest.approx(0, abs=1e-6)
    assert cloud.time[-1] == pytest.approx(0.1, abs=0.002)
    early = cloud.xyz[cloud.time < 0.02]
    assert early[:, 0].max() < 0  # the sweep begins behind


def test_velodyne_decoder_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "velodyne_decoder", None)
    path = write_capture(tmp_path / "drive.pcap", [(0.0, ethernet(packet)) for packet in vlp16_turns(0.2)])
    with pytest.raises(InputError, match=r"pip install 'lidarlift\[packets\]'"):
        open_dataset(path)
