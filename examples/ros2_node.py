"""A ROS 2 node that feeds Slam with sensor_msgs/PointCloud2 and publishes the pose as nav_msgs/Odometry.

Not run by the project: it needs ROS 2 (rclpy, sensor_msgs_py), which pip does not install. In a sourced ROS 2
environment with lidarlift installed:

python examples/ros2_node.py --ros-args -r points:=/velodyne_points -p sensor:=vlp16 -p out:=runs/ros
"""

from __future__ import annotations

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2
from sensor_msgs_py import point_cloud2

import lidarlift


class SlamNode(Node):
    """Subscribes to `points`, publishes `odometry`; parameters `sensor` and `out`."""

    def __init__(self) -> None:
        super().__init__("lidarlift")
        sensor = self.declare_parameter("sensor", "vlp16").value
        out = self.declare_parameter("out", "runs/ros").value
        self.slam = lidarlift.Slam(sensor=sensor, out=out)
        self.publisher = self.create_publisher(Odometry, "odometry", 10)
        self.create_subscription(PointCloud2, "points", self.on_scan, qos_profile_sensor_data)

    def on_scan(self, message: PointCloud2) -> None:
        """Register one scan and publish its pose, stamped as the scan."""
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        points = point_cloud2.read_points(message)  # structured array: x, y, z, and intensity, ring, time where sent
        step = self.slam.add(points, stamp)
        if step.status != "registered":
            self.get_logger().warning(f"scan {step.index}: {step.status}")
        pose = Odometry(child_frame_id=message.header.frame_id)
        pose.header.stamp, pose.header.frame_id = message.header.stamp, "map"
        position, turned = pose.pose.pose.position, pose.pose.pose.orientation
        position.x, position.y, position.z = (float(value) for value in step.pose[:3, 3])
        turned.x, turned.y, turned.z, turned.w = (float(q) for q in Rotation.from_matrix(step.pose[:3, :3]).as_quat())
        self.publisher.publish(pose)


def main() -> None:
    """Spin until Ctrl-C, then write the run folder."""
    rclpy.init()
    node = SlamNode()
    with node.slam:
        try:
            rclpy.spin(node)
        except KeyboardInterrupt:
            node.slam.finish()


if __name__ == "__main__":
    main()
