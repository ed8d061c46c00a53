"""Messages of ROS 1 and ROS 2 as objects; their stamps and frames."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Any, NamedTuple

from slam.data.point_blocks import UnreadableError
from slam.data.recordings.container import CDR, ROS1

HEAD = 4096  # bytes of a message that hold its header: frames have short names
CLOUD, IMAGE, COMPRESSED = (f"sensor_msgs/msg/{name}" for name in ("PointCloud2", "Image", "CompressedImage"))
CAMERA_INFO, IMU, FIX = (f"sensor_msgs/msg/{name}" for name in ("CameraInfo", "Imu", "NavSatFix"))
ODOMETRY, PATH, TRANSFORMS = "nav_msgs/msg/Odometry", "nav_msgs/msg/Path", "tf2_msgs/msg/TFMessage"
OLD_TRANSFORMS = "tf/msg/tfMessage"
STRING, VELODYNE_SCAN = "std_msgs/msg/String", "velodyne_msgs/msg/VelodyneScan"
POSE, POSE_WITH_COVARIANCE = (f"geometry_msgs/msg/{name}" for name in ("PoseStamped", "PoseWithCovarianceStamped"))


class Header(NamedTuple):
    """The header that most messages begin with.

    Attributes:
        stamp: Time stamp [ns].
        frame: Name of the frame, without a leading slash.
        end: Place in the message after the header.
    """

    stamp: int
    frame: str
    end: int


def header_of(content: bytes, encoding: str) -> Header:
    """Read the header of a message, of which the first `HEAD` bytes suffice.

    Raises:
        UnreadableError: The message is too short for one.
    """
    at, order = (4, "<") if encoding == ROS1 else (4, byte_order(content))
    try:
        seconds, nanoseconds, length = struct.unpack_from(f"{order}III", content, at)
        frame = content[at + 12 : at + 12 + length]
    except struct.error:
        raise UnreadableError("a message that is too short") from None
    if length > len(content):
        raise UnreadableError("a header that makes no sense")
    text = frame.rstrip(b"\0").decode("utf-8", "replace").lstrip("/")
    return Header(seconds * 10**9 + nanoseconds, text, at + 12 + length)


def byte_order(content: bytes) -> str:
    """Return the byte order of a message in CDR, '<' or '>'.

    Raises:
        UnreadableError: It is no such message.
    """
    if len(content) < 4 or content[0] != 0 or content[1] > 1:
        raise UnreadableError("no CDR message")
    return "<" if content[1] else ">"


@lru_cache(maxsize=2)
def _types(encoding: str) -> Any:
    return type_store(encoding == ROS1)


def type_store(ros1: bool) -> Any:
    """Return the message types of ROS 1 or ROS 2 as rosbags has them; TFMessage is added to those of ROS 1."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if ros1:
        types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TRANSFORMS))
    return types


def read_message(content: bytes, kind: str, encoding: str) -> Any:
    """Deserialise a message of one of ROS' own types.

    Returns:
        The message, an object of rosbags.

    Raises:
        UnreadableError: It is damaged.
    """
    types = _types(encoding)
    kind = TRANSFORMS if kind == OLD_TRANSFORMS else kind
    try:
        if encoding == ROS1:
            return types.deserialize_ros1(content, kind)
        if encoding == CDR:
            return types.deserialize_cdr(content, kind)
    except Exception as error:  # the generated code may raise anything on damaged bytes
        raise UnreadableError(f"a damaged {kind} ({type(error).__name__}: {error})") from error
    raise UnreadableError(f"messages encoded as '{encoding}'")
