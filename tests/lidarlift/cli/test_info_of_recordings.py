"""`lidarlift info` on recordings: topics, and what a run uses of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.slam.data.recordings.conftest import Event, clouds, mounting, nanoseconds
from tests.slam.data.recordings.conftest import record as record
from tests.slam.data.recordings.test_camera import BOTH, PICTURE, both_cameras, images, raw
from tests.slam.data.recordings.test_truth import TIMES, odometry

Command = Callable[..., Any]
Record = Callable[..., Path]


def imu() -> list[Event]:
    """200 per second, and none for half a second."""

    def write(writer: Any, recorded: int) -> None:
        zero, unknown = writer.vector("Vector3", (0, 0, 0)), np.zeros(9)
        message = writer.make(
            "sensor_msgs/msg/Imu",
            header=writer.header(recorded, "imu"),
            orientation=writer.quaternion(np.eye(3)),
            orientation_covariance=unknown,
            angular_velocity=zero,
            angular_velocity_covariance=unknown,
            linear_acceleration=zero,
            linear_acceleration_covariance=unknown,
        )
        writer.write("/imu/data", recorded, message)

    return [(0.005 * at, write) for at in range(220) if not 80 <= at < 180]


@pytest.fixture
def recording(record: Record) -> Path:
    events = [*clouds(), *both_cameras(), *mounting(BOTH), *odometry("/gt/odom", TIMES), *imu()]
    return record([event for event in events if nanoseconds(event[0]) >= nanoseconds(0.0)], "mcap")


def test_topics_and_their_use(lidarlift: Command, recording: Path) -> None:
    done = lidarlift("info", recording)
    assert done.code == 0, done.err
    lines = {line.split()[0]: " ".join(line.split()[1:]) for line in done.out.splitlines() if line.startswith("  /")}
    assert lines == {
        "/a_rear/camera_info": "CameraInfo 1",
        "/a_rear/image_raw": "Image 10 10 Hz images",
        "/cam/camera_info": "CameraInfo 1",
        "/cam/image_raw": "Image 10 10 Hz images",
        "/gt/odom": "Odometry 65 50 Hz truth",
        "/imu/data": "Imu 120 109 Hz IMU, not used, longest gap 0.505 s",
        "/tf_static": "TFMessage 1 mounting",
        "/velodyne_points": "PointCloud2 10 10 Hz points",
    }
    assert "images of 40 x 30 pixels for 10 of 10 scans, calibrated; 1 more" in done.out
    assert "headers" in done.out
    content = json.loads(lidarlift("info", recording, "--json").out)
    assert content["cameras"] == 2
    assert content["topics"][5]["longest_gap_s"] == pytest.approx(0.505)


def test_missing_images_are_counted(lidarlift: Command, record: Record) -> None:
    several = images(raw("rgb8", PICTURE))
    del several[4:7]
    events = [*clouds(), *several, *(event for event in both_cameras() if event[0] == 0.0), *mounting(BOTH)]
    assert "for 7 of 10 scans" in lidarlift("info", record(events)).out
