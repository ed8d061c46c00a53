"""Point clouds in messages as structured arrays, whose fields have the names and types that the driver gave them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import UnreadableError
from slam.data.point_files import WANTED
from slam.data.recordings.container import ROS1, number
from slam.data.recordings.messages import CLOUD, byte_order, header_of, read_message

#: PointField's types.
KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
LIVOX_POINT = [
    *[("offset_time", "u4"), ("x", "f4"), ("y", "f4"), ("z", "f4")],
    *[("reflectivity", "u1"), ("tag", "u1"), ("line", "u1")],
]


def point_cloud(content: bytes, encoding: str) -> Array:
    """Return the fields of a PointCloud2 that can be used.

    Returns:
        A structured array (N,), or (H, W) for an organised cloud.

    Raises:
        UnreadableError: The message is damaged, or its fields and sizes contradict each other.
    """
    message = read_message(content, CLOUD, encoding)
    height, width, step = int(message.height), int(message.width), int(message.point_step)
    if height * width == 0:
        return np.zeros(0, [(axis, "f4") for axis in "xyz"])
    stride = max(int(message.row_step), width * step) if height > 1 else width * step
    data = np.asarray(message.data, np.uint8)
    if step == 0 or len(data) < (height - 1) * stride + width * step:
        raise UnreadableError(f"a cloud of {height} x {width} points of {step} bytes in {len(data)} bytes")
    point = _layout(message.fields, step, ">" if message.is_bigendian else "<")
    if height == 1:
        return data[: width * step].view(point)
    if len(data) < height * stride:  # the last row lacks the padding of the others
        data = np.concatenate([data, np.zeros(height * stride - len(data), np.uint8)])
    rows = data[: height * stride].reshape(height, stride)[:, : width * step]
    return np.ascontiguousarray(rows).view(point)


def _layout(fields: list[object], step: int, order: str) -> np.dtype:
    """The type of a point of `step` bytes with the fields that can be used, without padding."""
    names, kinds, offsets = list[str](), list[str](), list[int]()
    for field in fields:
        name, kind = str(field.name), KINDS.get(int(field.datatype))  # type: ignore[attr-defined]
        offset, count = int(field.offset), int(field.count)  # type: ignore[attr-defined]
        if name.lower() not in WANTED or name in names or count > 1:
            continue
        if kind is None or offset + int(kind[1:]) > step:
            raise UnreadableError(f"a field {name} that is not within a point of {step} bytes")
        names.append(name)
        kinds.append(order + kind)
        offsets.append(offset)
    return np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": step})


def livox(content: bytes, encoding: str) -> Array:
    """Return the points (N,) of a CustomMsg of Livox' drivers.

    It is read here, since recordings need not have its definition, and an object for each point would be slow:

        Header header, uint64 timebase, uint32 point_num, uint8 lidar_id, uint8[3] rsvd, CustomPoint[] points
        CustomPoint: uint32 offset_time, float32 x, y, z, uint8 reflectivity, tag, line

    Raises:
        UnreadableError: The message is damaged.
    """
    at = header_of(content, encoding).end
    if encoding == ROS1:
        order, stride = "<", 19
    else:  # CDR: 8 and 4 bytes lie at multiples of their size after the first four bytes
        order, stride = byte_order(content), 20
        at += -(at - 4) % 8
    at += 8 + 4 + 4
    count = number(content, f"{order}I", at)
    at += 4
    if len(content) < at + count * stride - (stride - 19):
        raise UnreadableError(f"{count} points in {len(content)} bytes")
    fields = [(name, order + kind) for name, kind in LIVOX_POINT]
    point = np.dtype({"names": [name for name, _ in fields], "formats": [kind for _, kind in fields],
                      "offsets": [0, 4, 8, 12, 16, 17, 18], "itemsize": stride})  # fmt: skip
    return np.frombuffer(content[at:].ljust(count * stride, b"\0"), point, count)


#: Readers of the points of a scan by the type of its message: functions of a message's bytes and their encoding.
CLOUDS: dict[str, Callable[[bytes, str], Array]] = {
    CLOUD: point_cloud,
    "livox_ros_driver/msg/CustomMsg": livox,
    "livox_ros_driver2/msg/CustomMsg": livox,
    "livox_interfaces/msg/CustomMsg": livox,
}
