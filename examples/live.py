"""Feed scans one by one, as a driver delivers them, and print pose, uncertainty and status of each.

python examples/live.py my_scans --sensor vlp16 --out runs/live

A recording stands for the LiDAR here. `ros2_node.py` is the same with ROS 2.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

import lidarlift


def scans(folder: str, sensor: str | None) -> Iterator[tuple[float, lidarlift.PointCloud]]:
    """Yield stamps [s] and points. A driver's (N, 4) array x y z intensity, or structured array, serves as well."""
    data = lidarlift.open_dataset(folder, sensor=sensor)
    for position in range(len(data)):
        frame = data[position]
        yield frame.stamp, frame.cloud


def main() -> None:
    """Feed `Slam` until the scans end, then write the run folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="KITTI, or a folder of scans")
    parser.add_argument("--sensor", help="the LiDAR, where the folder does not say")
    parser.add_argument("--out", default="runs/live", help="the run folder")
    options = parser.parse_args()

    with lidarlift.Slam(sensor=options.sensor, out=options.out) as slam:
        for stamp, points in scans(options.dataset, options.sensor):
            step = slam.add(points, stamp)
            sigma = np.sqrt(np.diag(step.covariance)[3:]).max()  # m, of the motion since the last scan; rotation first
            print(f"{stamp:8.2f} s  {step.status:10}  x {step.pose[0, 3]:7.2f} m  sigma {sigma:.4f} m")
        slam.finish()
    print(f"Written to {options.out}")


if __name__ == "__main__":
    main()
