"""MulRan (Kim et al., ICRA 2020): an Ouster OS1-64 on a car in Korea."""

from __future__ import annotations

from pathlib import Path

from scipy.spatial.transform import Rotation

from slam.data.bin_layout import KITTI
from slam.data.derived_columns import PointImage
from slam.data.loaders.common import HERE, StampedSequence, folders_with, pose
from slam.data.point_files import Reading
from slam.data.pose_files import read_trajectory

#: calib_base2ouster.txt as KISS-ICP's loader quotes it: metres, and degrees about x, y, z.
T_BASE_LIDAR = pose(1.7042, -0.021, 1.8047, Rotation.from_euler("xyz", [0.0001, 0.0003, 179.6654], degrees=True))


class MulRan(StampedSequence):
    """`Ouster/<ns>.bin` (or `sensor_data/Ouster/`) and `global_pose.csv` of one sequence.

    Points are x y z intensity, float32, all 64 x 1024 of a turn, column by column: rings are the position modulo 64
    (the data set's own player, github.com/RPM-Robotics-Lab/file_player_mulran, src/ROSThread.cpp), and times follow
    from the column, counted from the stamp, as in Ouster's driver. A scan with fewer points has neither. The LiDAR is
    mounted backwards: its x axis, and that of the ground truth, points to the car's rear. Its laser lines are those of
    the first generation, which no built-in table has. global_pose.csv has ns and 3 x 4 of the car's base. Radar, IMU
    and GPS are not read.
    """

    LAYOUT = "MulRan (Ouster/*.bin beside global_pose.csv)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the sequences at or below a path by their names. See `Loader`."""
        found = folders_with(path, "Ouster/*.bin", "sensor_data/Ouster/*.bin")
        marks = ("global_pose.csv", "data_stamp.csv", "sensor_data")
        return {name: folder for name, folder in found.items() if any((folder / mark).exists() for mark in marks)}

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        scans = path / "Ouster" if (path / "Ouster").is_dir() else path / "sensor_data" / "Ouster"
        reading = Reading(KITTI, HERE, image=PointImage(64, 1024, 0.1))
        super().__init__(
            path,
            f"MulRan {path.name}",
            scans,
            ".bin",
            "ns",
            reading,
            sensor=sensor,
            instant="start",
            stamp=stamp,
            point_time=point_time,
        )
        truth = path / "global_pose.csv"
        if truth.is_file():
            self.take_trajectory(truth, read_trajectory(truth), T_BASE_LIDAR)
