"""NCLT (Carlevaris-Bianco et al., IJRR 2016): a Velodyne HDL-32E on a Segway at the University of Michigan."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.bin_layout import parsed_columns
from slam.data.loaders.common import HERE, StampedSequence, angle_trajectory, folders_with
from slam.data.point_files import Reading

STEP, LEAST = 0.005, -100.0  # m: step and lowest value of the integers in velodyne_sync (NCLT's read_vel_sync.py)
#: From the axes of files and ground truth, x forward, y right, z down, into ours.
AXES = ((STEP, 0.0, 0.0, LEAST), (0.0, -STEP, 0.0, -LEAST), (0.0, 0.0, -STEP, -LEAST))
TRUTH = ("utime", "x", "y", "z", "roll", "pitch", "heading")
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


class Nclt(StampedSequence):
    """`velodyne_sync/<us>.bin` of one day, and `groundtruth_<day>.csv` in it, beside it or in `ground_truth/`.

    A point is x y z as uint16, intensity and laser as uint8. The data set's makers transformed the scans into the
    robot's body frame and compensated the motion by wheel odometry: there are no times, and points lie off the laser
    lines. The ground truth (us x y z roll pitch heading, NaN at the beginning) is that of the body, too. Images and
    velodyne_hits.bin are not read.
    """

    LAYOUT = "NCLT (velodyne_sync/*.bin)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the days at or below a path by their names. See `Loader`."""
        return folders_with(path, "velodyne_sync/*.bin")

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        reading = Reading(parsed_columns("x:u2,y:u2,z:u2,intensity:u1,ring:u1"), HERE, AXES)
        super().__init__(
            path,
            f"NCLT {path.name}",
            path / "velodyne_sync",
            ".bin",
            "us",
            reading,
            sensor=sensor,
            stamp=stamp,
            point_time=point_time,
            compensated=True,
        )
        name = f"groundtruth_{path.name}.csv"
        places = [folder / name for folder in (path, path.parent, path.parent / "ground_truth", path / "ground_truth")]
        truth = next((place for place in places if place.is_file()), None)
        if truth is not None:
            self.take_trajectory(truth, angle_trajectory(truth, TRUTH), FLIP)
