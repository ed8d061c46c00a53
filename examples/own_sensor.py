"""Run SLAM on a LiDAR that lidarlift has no table of: describe its lasers in a YAML file.

python examples/own_sensor.py my_scans --rings 16 --lowest -15 --highest 15 --out runs/own

The lasers of this example are evenly spaced and leave the sensor's origin. For other LiDARs take the angles from the
data sheet, or let `lidarlift fit-lasers` estimate them from raw scans with a ring field.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import yaml

import lidarlift


def main() -> None:
    """Describe the LiDAR, check the rings, run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", type=Path, help="a folder of scans")
    parser.add_argument("--rings", type=int, default=16)
    parser.add_argument("--lowest", type=float, default=-15.0, help="elevation of the lowest laser [deg]")
    parser.add_argument("--highest", type=float, default=15.0, help="elevation of the highest laser [deg]")
    parser.add_argument("--out", default="runs/own", help="the run folder")
    options = parser.parse_args()

    elevations = np.linspace(options.highest, options.lowest, options.rings)  # deg, top first
    sensor = {"model": "own-lidar", "beams": [[float(elevation), 0.0] for elevation in elevations]}
    file = Path("own-lidar.yaml")  # as sensor.yaml beside the scans, it would need no naming
    file.write_text(yaml.safe_dump(sensor))

    data = lidarlift.open_dataset(options.scans, sensor=file)
    cloud = data[0].cloud
    points = np.bincount(cloud.ring, minlength=options.rings)
    print(f"Points per ring of the first scan, top first: {points.tolist()}")  # gaps show wrong angles
    run = lidarlift.run(data, input="enriched", enricher="ray-segment", out=options.out)
    print(f"Frames by status: {run.counts()}")


if __name__ == "__main__":
    main()
