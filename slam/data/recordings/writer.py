"""Writing of recordings: ROS 1 bags, and ROS 2 recordings in SQLite or MCAP, message by message."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.recordings.clouds import KINDS, LIVOX_POINT
from slam.data.recordings.messages import TRANSFORMS, type_store

#: Forms of recordings, and the suffix of each.
FORMS = {"bag": ".bag", "ros2": ".db3", "mcap": ".mcap"}
POINT_FIELDS = {kind: number for number, kind in KINDS.items()}
LIVOX = "livox_ros_driver2/msg/CustomMsg"
LIVOX_DEFINITIONS = {
    "livox_ros_driver2/msg/CustomPoint": "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\n"
    "uint8 reflectivity\nuint8 tag\nuint8 line\n",
    LIVOX: "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
    "livox_ros_driver2/CustomPoint[] points\n",
}


class RecordingWriter:
    """Writer of messages of rosbags' types.

    Args:
        writer: A writer of rosbags.
        types: Its store of message types.
        ros1: Whether the messages are of ROS 1.

    Attributes:
        types: The store of message types.
    """

    def __init__(self, writer: Any, types: Any, ros1: bool) -> None:
        self._writer, self.types, self._ros1 = writer, types, ros1
        self._connections: dict[str, Any] = {}

    def write(self, topic: str, nanoseconds: int, message: Any) -> None:
        """Write a message as recorded at a time [ns]; all messages of a topic have one type."""
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self.types)
        serialize = self.types.serialize_ros1 if self._ros1 else self.types.serialize_cdr
        self._writer.write(self._connections[topic], nanoseconds, serialize(message, kind))

    def make(self, kind: str, **fields: Any) -> Any:
        """Make a message of a type; names of fields are in lower case, as ROS 2 has them."""
        made = self.types.types[kind]
        names = {name.lower() if name.isupper() else name: name for name in made.__dataclass_fields__}
        return made(**{names[name]: value for name, value in fields.items()})

    def time(self, nanoseconds: int) -> Any:
        """Make a stamp."""
        return self.make("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)

    def header(self, nanoseconds: int, frame: str) -> Any:
        """Make the header that most messages begin with."""
        sequence = {"seq": 0} if self._ros1 else {}
        return self.make("std_msgs/msg/Header", **sequence, stamp=self.time(nanoseconds), frame_id=frame)

    def vector(self, kind: str, xyz: Sequence[float] | Array) -> Any:
        """Make a message of geometry_msgs with x, y and z: a Point, a Vector3."""
        x, y, z = map(float, xyz)
        return self.make(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)

    def quaternion(self, rotation: Array) -> Any:
        """Make a Quaternion of a rotation (3, 3)."""
        x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True).tolist()
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, T: Array) -> Any:
        """Make a Pose of a pose (4, 4)."""
        position = self.vector("Point", T[:3, 3])
        return self.make("geometry_msgs/msg/Pose", position=position, orientation=self.quaternion(T[:3, :3]))

    def stamped_pose(self, nanoseconds: int, frame: str, T: Array) -> Any:
        """Make a PoseStamped of a pose (4, 4)."""
        return self.make("geometry_msgs/msg/PoseStamped", header=self.header(nanoseconds, frame), pose=self.pose(T))

    def odometry(self, nanoseconds: int, frame: str, child: str, T: Array) -> Any:
        """Make an Odometry of a pose (4, 4); covariances and velocities are 0, which means unknown."""
        none = np.zeros(36)
        zero = self.vector("Vector3", (0, 0, 0))
        twist = self.make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(nanoseconds, frame),
            child_frame_id=child,
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(T), covariance=none),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=none),
        )

    def transform(self, nanoseconds: int, parent: str, child: str, T: Array) -> Any:
        """Make a TransformStamped of T_parent_child (4, 4)."""
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(nanoseconds, parent),
            child_frame_id=child,
            transform=self.make(
                "geometry_msgs/msg/Transform",
                translation=self.vector("Vector3", T[:3, 3]),
                rotation=self.quaternion(T[:3, :3]),
            ),
        )

    def transforms(self, found: Mapping[tuple[str, str], Array]) -> Any:
        """Make a TFMessage of T_parent_child (4, 4) by parent and child, at time 0."""
        listed = [self.transform(0, parent, child, T) for (parent, child), T in found.items()]
        return self.make(TRANSFORMS, transforms=listed)

    def cloud(self, nanoseconds: int, frame: str, points: Array, dense: bool = True) -> Any:
        """Make a PointCloud2 of a structured array, (N,) or organised (H, W)."""
        table = np.atleast_2d(points)
        kind, step = table.dtype, table.dtype.itemsize
        fields = [
            self.make(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=int((kind.fields or {name: (kind, 0)})[name][1]),
                datatype=POINT_FIELDS[kind[name].str[1:]],
                count=1,
            )
            for name in kind.names or ()
        ]
        return self.make(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(nanoseconds, frame),
            height=table.shape[0],
            width=table.shape[1],
            fields=fields,
            is_bigendian=False,
            point_step=step,
            row_step=step * table.shape[1],
            data=np.frombuffer(np.ascontiguousarray(table).tobytes(), np.uint8),
            is_dense=dense,
        )

    def livox(self, nanoseconds: int, frame: str, points: Array) -> Any:
        """Make a CustomMsg of Livox' driver of points (N,) with the fields of `LIVOX_POINT`."""
        make = self.types.types["livox_ros_driver2/msg/CustomPoint"]
        names = [name for name, _ in LIVOX_POINT]
        return self.make(
            LIVOX,
            header=self.header(nanoseconds, frame),
            timebase=nanoseconds,
            point_num=len(points),
            lidar_id=0,
            rsvd=np.zeros(3, np.uint8),
            points=[make(*row) for row in points[names].tolist()],
        )


@contextmanager
def recording_writer(path: Path, form: str) -> Iterator[RecordingWriter]:
    """Write a recording: name.bag; name.db3 or name.mcap, and the metadata.yaml of ROS 2.

    Files of that name are replaced after the last message; after an error they are unchanged.

    Args:
        path: The file without suffix.
        form: One of `FORMS`.

    Yields:
        The writer of its messages.

    Raises:
        InputError: The folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=path.parent, prefix=".") as temporary:
            inside = Path(temporary) / path.name
            with _opened(inside, form) as writer:
                yield writer
            written = [inside.with_name(inside.name + ".bag")] if form == "bag" else sorted(inside.iterdir())
            for file in written:
                shutil.move(file, path.parent / file.name)
    except OSError as error:
        raise InputError(f"{path}{FORMS[form]}: cannot be written ({error.strerror or error})") from error


@contextmanager
def _opened(path: Path, form: str) -> Iterator[RecordingWriter]:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import get_types_from_msg

    types = type_store(form == "bag")
    for kind, definition in LIVOX_DEFINITIONS.items():
        types.register(get_types_from_msg(definition, kind))
    if form == "bag":
        with Writer1(path.with_name(path.name + ".bag")) as bag:
            yield RecordingWriter(bag, types, ros1=True)
        return
    plugin = StoragePlugin.MCAP if form == "mcap" else StoragePlugin.SQLITE3
    with Writer2(path, version=8, storage_plugin=plugin) as recording:
        yield RecordingWriter(recording, types, ros1=False)
