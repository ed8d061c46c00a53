"""ParisLuco (Dellenbach et al., ICRA 2022): a Velodyne HDL-32E on a car around the Jardin du Luxembourg."""

from __future__ import annotations

from pathlib import Path

from slam.data.loaders.common import HERE, StampedSequence, folders_with
from slam.data.point_files import Reading
from slam.data.sensor import load_sensor

TRUTH = "gt_traj_lidar.txt"


class ParisLuco(StampedSequence):
    """`frames/frame_<number>.ply` of one sequence.

    Points have `timestamp`, seconds from the middle of the turn, when the LiDAR looks ahead. Files have no rings, which
    follow from the nearest laser line, and no stamps of the scans: 10 per second are assumed. gt_traj_lidar.txt has
    positions only, which are not read: ground truth needs poses.
    """

    LAYOUT = f"ParisLuco (frames/*.ply beside {TRUTH})"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the sequences at or below a path by their names. See `Loader`."""
        found = folders_with(path, "frames/*.ply")
        return {name: folder for name, folder in found.items() if (folder / TRUTH).is_file()}

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        super().__init__(
            path,
            f"ParisLuco {path.name}",
            path / "frames",
            ".ply",
            None,
            Reading(offset=HERE),
            default=load_sensor("hdl32"),
            sensor=sensor,
            stamp=stamp,
            point_time=point_time,
        )
        self.without_truth(f"{path / TRUTH}: positions without rotations are not read")
