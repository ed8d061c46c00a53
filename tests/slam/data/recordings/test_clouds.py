"""PointCloud2 in all shapes, and what contradicts itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.data.point_blocks import UnreadableError
from slam.data.recordings.clouds import livox, point_cloud
from slam.data.recordings.container import CDR, ROS1
from slam.data.recordings.messages import CLOUD, header_of, type_store
from slam.data.recordings.writer import LIVOX, RecordingWriter

WRITER = RecordingWriter(None, type_store(False), ros1=False)
POINT = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("ring", "<u2")]
POINTS = np.array([(1, 2, 3, 7), (4, 5, 6, 8), (-1, -2, -3, 9)], POINT)


def table_of(points: Any = POINTS, **changes: Any) -> Any:
    message = WRITER.cloud(1, "lidar", points)
    for name, value in changes.items():
        setattr(message, name, value)
    return point_cloud(bytes(type_store(False).serialize_cdr(message, CLOUD)), CDR)


def field(name: str, offset: int, datatype: int, count: int = 1) -> Any:
    return WRITER.make("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=datatype, count=count)


def test_big_endian_points() -> None:
    swapped = POINTS.astype(POINTS.dtype.newbyteorder(">"))
    found = table_of(data=np.frombuffer(swapped.tobytes(), np.uint8), is_bigendian=True)
    for name in ("x", "z", "ring"):
        np.testing.assert_array_equal(found[name], POINTS[name])


def test_rows_with_something_behind_them() -> None:
    image = np.stack([POINTS, POINTS[::-1]])
    padded = np.zeros((2, POINTS.nbytes + 10), np.uint8)
    padded[:, : POINTS.nbytes] = image.view(np.uint8).reshape(2, -1)
    found = table_of(image, data=padded.ravel(), row_step=padded.shape[1])
    assert found.shape == (2, 3)
    np.testing.assert_array_equal(found["x"], image["x"])
    short = table_of(image, data=padded.ravel()[:-10], row_step=padded.shape[1])
    np.testing.assert_array_equal(short["x"], image["x"])


def test_a_row_step_of_zero_is_that_of_the_points() -> None:
    np.testing.assert_array_equal(table_of(row_step=0)["y"], POINTS["y"])


def test_padding_and_fields_of_several_numbers_are_passed_by() -> None:
    fields = [field("x", 0, 7), field("_", 4, 7), field("_", 8, 2, 4), field("y", 4, 7), field("z", 8, 7)]
    found = table_of(fields=[*fields, field("normal", 0, 7, 3), field("time", 0, 8, 3)])
    assert found.dtype.names == ("x", "y", "z")


def test_no_points() -> None:
    assert table_of(POINTS[:0]).size == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width": 4}, "1 x 4 points of 14 bytes in 42 bytes"),
        ({"point_step": 0}, "points of 0 bytes"),
        ({"height": 3}, "3 x 3 points"),
        ({"fields": [field("x", 12, 7)]}, "a field x that is not within a point of 14 bytes"),
        ({"fields": [field("x", 0, 77)]}, "a field x that is not within"),
    ],
)
def test_contradictions_are_damage(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(UnreadableError, match=message):
        table_of(**changes)


@given(cut=st.integers(0, 250), ros1=st.booleans())
def test_cut_messages_are_damage(cut: int, ros1: bool) -> None:
    types = type_store(ros1)
    message = RecordingWriter(None, types, ros1).cloud(1, "lidar", POINTS)
    content = bytes(types.serialize_ros1(message, CLOUD) if ros1 else types.serialize_cdr(message, CLOUD))
    try:
        point_cloud(content[:cut], ROS1 if ros1 else CDR)
    except UnreadableError:
        return
    assert cut >= len(content) - 4


@pytest.mark.parametrize("ros1", [True, False])
@pytest.mark.parametrize("frame", ["", "a", "livox", "livox_frame"])
def test_livox_points_whatever_the_length_of_the_frame(ros1: bool, frame: str) -> None:
    from rosbags.typesys import get_types_from_msg

    from slam.data.recordings.writer import LIVOX_DEFINITIONS
    from slam.simulation.drivers import LIVOX as POINT

    types = type_store(ros1)
    for kind, definition in LIVOX_DEFINITIONS.items():
        types.register(get_types_from_msg(definition, kind))
    points = np.array([(5, 1, 2, 3, 200, 16, 2), (9, -1, -2, -3, 100, 16, 5)], POINT)
    message = RecordingWriter(None, types, ros1).livox(1_700_000_000_000_000_007, frame, points)
    content = bytes(types.serialize_ros1(message, LIVOX) if ros1 else types.serialize_cdr(message, LIVOX))
    encoding = ROS1 if ros1 else CDR
    found = livox(content, encoding)
    for name in POINT.names or ():
        np.testing.assert_array_equal(found[name], points[name])
    assert header_of(content, encoding)[:2] == (1_700_000_000_000_000_007, frame)
    with pytest.raises(UnreadableError):
        livox(content[:-8], encoding)
