"""Evaluate the trajectory of any system against a reference, and plot the error along the path.

python examples/evaluate_trajectory.py results/latest/04_poses_kitti.txt kitti/poses/04.txt --out error.png

Both files have KITTI's or TUM's format. KITTI's ground truth consists of poses of camera 0, and so does a trajectory
that KISS-ICP writes with its KITTI loader. For poses of the LiDAR, as lidarlift writes them, add --calib: it brings the
reference into the LiDAR's frame.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import lidarlift
from eval.body_frame import read_camera0_calibration
from eval.plot import plot_trajectory
from slam.data.pose_files import read_poses


def main() -> None:
    """Print the figures and draw the plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("estimate", type=Path)
    parser.add_argument("reference", type=Path)
    parser.add_argument("--calib", type=Path, help="KITTI's calib.txt of the sequence")
    parser.add_argument("--out", type=Path, default=Path("error.png"), help="the picture")
    options = parser.parse_args()

    metrics = lidarlift.evaluate(options.estimate, options.reference, options.calib)
    print(f"ATE {metrics.ate.aligned.rmse:.3f} m, SE(3)-aligned, over {metrics.reference_path_length_m:.1f} m")
    print(f"{metrics.frames} poses; {metrics.protocol['frame']}")

    stamps, estimate = read_poses(options.estimate)
    reference_stamps, reference = read_poses(options.reference)
    if options.calib:
        T_camera_lidar = read_camera0_calibration(options.calib)
        reference = np.linalg.inv(T_camera_lidar) @ reference @ T_camera_lidar
    plot_trajectory(options.out, estimate, reference, options.estimate.name, stamps, reference_stamps)
    print(f"Picture: {options.out}")


if __name__ == "__main__":
    main()
