"""HeLiPR (Jung et al., IJRR 2024): four LiDARs on a car in Korea."""

from __future__ import annotations

from pathlib import Path

from slam.data.bin_layout import Layout, parsed_columns
from slam.data.errors import InputError
from slam.data.loaders.common import HERE, StampedSequence
from slam.data.point_files import Reading
from slam.data.pose_files import read_trajectory
from slam.data.sensor import load_sensor

#: Columns of each LiDAR, from the data set's own player (github.com/minwoo0611/HeLiPR-File-Player, src/ROSThread.cpp).
#: `t` is in ns from the stamp, Velodyne's time in seconds. Line numbers of Avia and Aeva are not rings.
POINTS = {
    "Ouster": "x,y,z,intensity,t:u4,reflectivity:u2,ring:u2,ambient:u2",
    "Velodyne": "x,y,z,intensity,ring:u2,time",
    "Avia": "x,y,z,intensity:u1,_:u1,_:u1,t:u4",
    "Aeva": "x,y,z,reflectivity,_,t:i4,_:u1,intensity",
}
#: Scans of the Aeva up to this stamp [ns] have no last column.
AEVA_WITHOUT_INTENSITY = 1691936557946849179


class Helipr(StampedSequence):
    """`LiDAR/<Ouster | Velodyne | Avia | Aeva>/<ns>.bin` of one sequence, and `LiDAR_GT/<sensor>_gt.txt`.

    A sequence has one LiDAR: Ouster OS2-128, Velodyne VLP-16, Livox Avia or Aeva Aeries II. The laser lines of the
    Ouster's unit are not known, so that it is not enriched; Avia and Aeva have no rings. The ground truth is in TUM's
    form (ns x y z qx qy qz qw), of that LiDAR itself. Inertial, IMU and GPS data are not read.
    """

    LAYOUT = f"HeLiPR (LiDAR/<{' | '.join(POINTS)}>/*.bin)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the LiDARs of a sequence by their names, or those of the sequences below a path: 'Town01/Ouster'."""
        if path.name in POINTS and path.parent.name == "LiDAR":
            return {path.name: path}
        own = {name: path / "LiDAR" / name for name in POINTS if any((path / "LiDAR" / name).glob("*.bin"))}
        if own:
            return own
        sequences = sorted(folder.parent for folder in path.glob("*/LiDAR") if folder.is_dir())
        found = [(sequence, name) for sequence in sequences for name in POINTS]
        places = {f"{sequence.name}/{name}": sequence / "LiDAR" / name for sequence, name in found}
        return {name: folder for name, folder in places.items() if any(folder.glob("*.bin"))}

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
    ) -> None:
        sequence = path.parent.parent
        super().__init__(
            path,
            f"HeLiPR {sequence.name} {path.name}",
            path,
            ".bin",
            "ns",
            Reading(_layout(path), HERE),
            default=load_sensor("vlp16") if path.name == "Velodyne" else None,
            sensor=sensor,
            stamp=stamp,
            point_time=point_time,
        )
        truth = sequence / "LiDAR_GT" / f"{path.name}_gt.txt"
        if truth.is_file():
            self.take_trajectory(truth, read_trajectory(truth, "xyzw"))


def _layout(path: Path) -> Layout:
    first = min((file.stem for file in path.glob("*.bin") if file.stem.isdigit()), key=int, default=None)
    if first is None:
        raise InputError(f"{path}: no scans named by their stamps, like 1691936557946849179.bin; unpack HeLiPR's there")
    columns = POINTS[path.name]
    if path.name == "Aeva" and int(first) <= AEVA_WITHOUT_INTENSITY:
        columns = columns.removesuffix(",intensity")
    return parsed_columns(columns)
