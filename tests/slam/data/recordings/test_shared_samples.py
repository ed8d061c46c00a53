"""A real bag, of raw packets of an Ouster: what is in it is said, and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError
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


def test_packets_are_no_clouds(bag: Path) -> None:
    with pytest.raises(InputError, match=r"/os_node0/lidar_packets \(PacketMsg, 32\) may be the LiDAR's packets"):
        open_dataset(bag)
