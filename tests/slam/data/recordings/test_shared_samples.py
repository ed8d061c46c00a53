"""A real bag of an Ouster's packets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from slam.data.dataset import open_dataset
from slam.data.recordings.recording import Recording


@pytest.fixture
def bag(archives: Path) -> Path:
    path = archives / "loader_samples" / "os_packets_ros1.bag"
    if not path.is_file():
        pytest.skip(f"no {path.name} in {path.parent}")
    return path


def test_its_topics(bag: Path) -> None:
    topics = Recording(bag, [bag]).topics
    assert {name: (topic.type, topic.count) for name, topic in topics.items()} == {
        "/os_node0/imu_packets": ("ouster_ros/msg/PacketMsg", 10),
        "/os_node0/lidar_packets": ("ouster_ros/msg/PacketMsg", 32),
        "/os_node0/metadata": ("std_msgs/msg/String", 1),
    }
    assert topics["/os_node0/imu_packets"].rate == pytest.approx(100, rel=0.1)


def test_its_packets_are_a_scan(bag: Path) -> None:
    data: Any = open_dataset(bag)
    assert (len(data), data.problems) == (1, ())
    assert (data.sensor.name, data.rings) == ("OS-0-128", 128)
    cloud = data[0].cloud
    assert len(cloud) > 20_000
    assert 0.09 < cloud.time.max() < 0.1
