from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.packets.ouster import OusterDecoder, decode
from slam.data.packets.ouster_metadata import PROFILES, Metadata, parse_metadata

from .conftest import METADATA, STEP, legacy_packet


def metadata(**changes: Any) -> Metadata:
    return parse_metadata(json.dumps(METADATA | changes), "m.json")


def xyz_of(points: Array) -> Array:
    return np.column_stack([points[axis] for axis in "xyz"])


def test_points_follow_the_manuals_formula() -> None:
    points = decode([legacy_packet(0, 0), legacy_packet(0, 16)], metadata())
    assert len(points) == 4 * 32
    # Column 8 of 32: the head has turned by a quarter, clockwise. Its frame is turned by half a turn to the sensor's.
    (point,) = points[(points["t"] == 8 * STEP) & (points["ring"] == 1)]
    head, beam = 2 * np.pi * (1 - 8 / 32), np.deg2rad(-1.0)
    reach = 10 - 0.015806
    x = reach * np.cos(head + beam) + 0.015806 * np.cos(head)
    y = reach * np.sin(head + beam) + 0.015806 * np.sin(head)
    assert (point["x"], point["y"], point["z"]) == pytest.approx((-x, -y, 0.03618), abs=1e-5)


def test_points_lie_on_the_laser_lines() -> None:
    about = metadata()
    points = decode([legacy_packet(0, 0, 3000), legacy_packet(0, 16, 30_000)], about)
    rho = np.hypot(points["x"], points["y"])
    line = np.tan(about.sensor.elevation)[points["ring"]] * rho + about.sensor.offset[points["ring"]]
    np.testing.assert_allclose(points["z"], line, atol=1e-4)
    assert (np.diff(about.sensor.elevation) < 0).all()


def test_rings_count_from_the_top_whatever_the_order_of_the_beams() -> None:
    about = metadata(beam_altitude_angles=[-20.0, 10.0, 0.0, -10.0])
    points = decode([legacy_packet(0, 0)], about)
    assert points["ring"][:4].tolist() == [3, 0, 1, 2]
    assert points["reflectivity"][:4].tolist() == [0, 1, 2, 3]  # of the beams, in the packet's order
    heights = [points["z"][points["ring"] == ring].mean() for ring in range(4)]
    assert heights == sorted(heights, reverse=True)


def test_packets_in_any_order_twice_or_longer_give_the_same() -> None:
    first, second = legacy_packet(0, 0), legacy_packet(0, 16)
    points = decode([first, second], metadata())
    for packets in ([second, first], [first, second, first], [first + b"\x00", second + b"\x00"]):
        assert np.array_equal(decode(packets, metadata()), points)


def test_columns_that_are_not_valid_and_pixels_without_return_are_left_out() -> None:
    assert len(decode([legacy_packet(0, 0, valid=False)], metadata())) == 0
    assert len(decode([legacy_packet(0, 0, millimetres=0)], metadata())) == 0
    assert len(decode([], metadata())) == 0
    assert len(decode([legacy_packet(0, 32)], metadata())) == 0  # columns that a turn does not have
    points = decode([legacy_packet(0, 0, valid=False), legacy_packet(0, 16)], metadata())
    assert points["t"].min() == 0
    assert points["t"].max() == 15 * STEP


@pytest.mark.parametrize("profile", sorted(set(PROFILES) - {"LEGACY"}))
def test_each_profile(profile: str) -> None:
    """12.344 m and a reflectivity of 201 in every pixel, written where Ouster's manual has them."""
    about = metadata(udp_profile_lidar=profile)
    kind = PROFILES[profile]
    pixel = bytearray(kind.size)
    if kind.range_bits == 15:
        struct.pack_into("<H", pixel, 0, 12_344 // 8 | 0x8000)  # the highest bit is a flag
    else:
        struct.pack_into("<I", pixel, 0, 12_344 | 0b10101 << 19)
    pixel[kind.reflectivity] = 201
    columns = [struct.pack("<QHH", 5000 + at, at, 1) + bytes(pixel) * 4 for at in range(16)]
    packet = struct.pack("<HH", 1, 77).ljust(32, b"\x00") + b"".join(columns) + bytes(32)
    assert OusterDecoder(about).frame_of(packet) == 77
    assert OusterDecoder(about).frame_of(packet + b"\x00") is None
    points = decode([packet], about)
    assert len(points) == 64
    assert set(points["reflectivity"]) == {201}
    low = xyz_of(points[points["ring"] == 1]).astype(np.float64) - [0, 0, 0.03618]
    assert np.linalg.norm(low, axis=1) == pytest.approx(12.344, abs=0.001)  # a degree beside the head: nearly straight


def test_newer_metadata_has_the_same_in_groups() -> None:
    grouped = {
        "beam_intrinsics": {name: METADATA[name] for name in METADATA if name.startswith(("beam_", "lidar_origin"))},
        "lidar_intrinsics": {"lidar_to_sensor_transform": METADATA["lidar_to_sensor_transform"]},
        "lidar_data_format": METADATA["data_format"] | {"udp_profile_lidar": "LEGACY"},
        "config_params": {"lidar_mode": "32x10"},
        "sensor_info": {"prod_line": "OS-1-4", "prod_sn": "123"},
    }
    packets = [legacy_packet(0, 0)]
    found = parse_metadata(json.dumps(grouped), "m.json")
    assert np.array_equal(decode(packets, found), decode(packets, metadata()))
    assert (found.name, found.serial) == ("OS-1-4", 123)


def test_old_metadata_without_beam_origin_and_format() -> None:
    old = {name: METADATA[name] for name in ("prod_line", "lidar_mode", "beam_altitude_angles", "beam_azimuth_angles")}
    found = parse_metadata(json.dumps(old), "m.json")
    packets = [legacy_packet(0, 0), legacy_packet(0, 16)]
    assert np.array_equal(decode(packets, found), decode(packets, metadata()))


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"beam_altitude_angles": None}, "beam_altitude_angles"),
        ({"beam_altitude_angles": []}, "beam_altitude_angles"),
        ({"beam_azimuth_angles": [1.0, 2.0]}, "'beam_azimuth_angles' must be 4 numbers"),
        ({"beam_azimuth_angles": ["a", "b", "c", "d"]}, "must be 4 numbers"),
        ({"lidar_to_sensor_transform": [1, 2]}, "must be 16 numbers"),
        ({"data_format": {"columns_per_frame": -3}}, "'columns_per_frame' is -3"),
        ({"data_format": {}, "lidar_mode": "fast"}, "'columns_per_frame' is None"),
        ({"udp_profile_lidar": "RNG99"}, "packets of profile RNG99 are not read"),
        ({"lidar_origin_to_beam_origin_mm": "far"}, "must be 1 number"),
    ],
)
def test_metadata_that_make_no_sense_are_refused(changes: dict[str, Any], fault: str) -> None:
    with pytest.raises(InputError, match=rf"^m\.json: .*{fault}"):
        metadata(**changes)


@pytest.mark.parametrize("text", ["", "[]", "3", "{}", '{"a": 1}', "no json"])
def test_what_are_no_metadata_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^m\.json: .*metadata is needed"):
        parse_metadata(text, "m.json")


def test_metadata_of_another_sensor_of_the_same_kind_do_not_fit() -> None:
    about = metadata(udp_profile_lidar="RNG15_RFL8_NIR8")
    packet = bytearray(about.packet.itemsize)
    assert about.misfit(bytes(packet)) == ""
    packet[7:12] = (123).to_bytes(5, "little")
    assert about.misfit(bytes(packet)) == ""
    packet[7:12] = (124).to_bytes(5, "little")
    assert about.misfit(bytes(packet)) == "it is of sensor 123, but packets are of 124"
    assert metadata(udp_profile_lidar="RNG15_RFL8_NIR8", prod_sn="").misfit(bytes(packet)) == ""
