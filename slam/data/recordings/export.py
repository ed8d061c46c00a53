"""A run's trajectory and map as an MCAP file for RViz and Foxglove."""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.data.recordings.messages import TRANSFORMS
from slam.data.recordings.writer import RecordingWriter, recording_writer

WORLD, LIDAR = "map", "lidar"
PATH_TOPIC, ODOMETRY_TOPIC, MAP_TOPIC = "/lidarlift/path", "/lidarlift/odometry", "/lidarlift/map"
MAP_POINTS = 2_000_000  # of a message: viewers and networks refuse much larger messages


def write_mcap(path: Path, stamps: Array, poses: Array, cloud: PointCloud) -> None:
    """Write map and path at the first stamp, and Odometry and a transform at each stamp.

    Args:
        path: The file.
        stamps: (N,) [s].
        poses: (N, 4, 4) T_map_lidar.
        cloud: The map, written as PointCloud2; a large one in parts, each on a topic of its own.

    Raises:
        InputError: The file cannot be written.
    """
    times = [round(stamp * 1e9) for stamp in stamps.tolist()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=path.parent, prefix=".") as temporary:
            with recording_writer(Path(temporary) / "run", "mcap") as writer:
                _write_map(writer, times[0], cloud)
                _write_path(writer, times, poses)
                for time, pose in zip(times, poses, strict=True):
                    writer.write(ODOMETRY_TOPIC, time, writer.odometry(time, WORLD, LIDAR, pose))
                    transform = writer.transform(time, WORLD, LIDAR, pose)
                    writer.write("/tf", time, writer.make(TRANSFORMS, transforms=[transform]))
            shutil.move(Path(temporary) / "run.mcap", path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error


def _write_path(writer: RecordingWriter, times: list[int], poses: Array) -> None:
    header = writer.header(times[0], WORLD)
    poses_ = [writer.stamped_pose(time, WORLD, pose) for time, pose in zip(times, poses, strict=True)]
    writer.write(PATH_TOPIC, times[0], writer.make("nav_msgs/msg/Path", header=header, poses=poses_))


def _write_map(writer: RecordingWriter, time: int, cloud: PointCloud) -> None:
    kinds = [*((axis, "<f4") for axis in "xyz"), ("intensity", "<f4")]
    if cloud.colour is not None:
        kinds.append(("rgb", "<f4"))
    for part, start in enumerate(range(0, len(cloud), MAP_POINTS)):
        some = cloud.select(slice(start, start + MAP_POINTS))
        points = np.empty(len(some), kinds)
        for axis, name in enumerate("xyz"):
            points[name] = some.xyz[:, axis]
        points["intensity"] = some.intensity
        if some.colour is not None:
            red, green, blue = some.colour.T.astype(np.uint32)
            points["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
        writer.write(f"{MAP_TOPIC}_{part}" if part else MAP_TOPIC, time, writer.cloud(time, WORLD, points))
