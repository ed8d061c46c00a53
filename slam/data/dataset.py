"""A drive as a sequence of frames, and the door to all kinds of them."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from slam.data.cloud import Array, Calibration, Frame
from slam.data.errors import InputError
from slam.data.folder import UserFolder, scans_in
from slam.data.kitti_odometry import KittiOdometry
from slam.data.kitti_raw import KittiRaw
from slam.data.problem import Problem
from slam.data.sensor import Sensor


class Dataset(Protocol):
    """N frames of a drive; `dataset[i]` reads the i-th from disk, keeps nothing, and may be called from any thread.

    name          for tables and run.json, like 'KITTI odometry 04'
    path          the folder it was read from
    sensor        the LiDAR's laser lines, or None where nobody said which LiDAR it was
    calibration   the camera beside it, or None
    numbers       (N,) int64, the numbers in the file names: Frame.index
    stamps        (N,) float64, seconds
    ground_truth  (N, 4, 4) float64 T_world_lidar, the first known one identity, NaN where unknown; or None
    problems      what is wrong with the data set as a whole; `Frame.problems` is for single scans
    """

    @property
    def name(self) -> str: ...
    @property
    def path(self) -> Path: ...
    @property
    def sensor(self) -> Sensor | None: ...
    @property
    def calibration(self) -> Calibration | None: ...
    @property
    def numbers(self) -> Array: ...
    @property
    def stamps(self) -> Array: ...
    @property
    def ground_truth(self) -> Array | None: ...
    @property
    def problems(self) -> tuple[Problem, ...]: ...

    def __len__(self) -> int: ...
    def __getitem__(self, position: int) -> Frame: ...


def open_dataset(path: str | Path, sequence: str | None = None, sensor: str | Path | None = None) -> Dataset:
    """The drive in a folder: KITTI odometry, KITTI raw, or a folder of scans of the user's own (`UserFolder`).

    `path` may be KITTI odometry's root, its `sequences` folder or one sequence; of KITTI raw the root, a date or a
    drive (`..._sync`). `sequence` ('04'; '0005') picks one where there are several. `sensor` (see `load_sensor`)
    overrides what the folder says. Raises InputError where nothing fits, saying what was looked for.
    """
    path = Path(path).expanduser()
    if not path.is_dir():
        fault = "is a file, not a folder with scans" if path.exists() else "no such folder"
        raise InputError(f"{path}: {fault}; name the folder of a drive")
    path = path.resolve() if ".." in path.parts else path.absolute()  # symbolic links stay: poses/ may lie beside them
    sequences, drives = _odometry_sequences(path), _raw_drives(path)
    if sequences:
        return KittiOdometry(_pick(path, sequences, sequence, "sequence"), sensor)
    if drives:
        return KittiRaw(_pick(path, drives, sequence, "drive"), sensor)
    if scans_in(path):
        if sequence is not None:
            raise InputError(f"{path}: a folder of scans has no sequence '{sequence}'; leave --sequence out")
        return UserFolder(path, sensor)
    raise InputError(
        f"{path}: no drive found; looked for KITTI odometry (sequences/NN/velodyne/*.bin, or calib.txt beside "
        "velodyne/), KITTI raw (*_sync/velodyne_points/data/*.bin) and scans (.bin, .pcd, .ply, .npy) in the folder "
        "itself or in its scans/, velodyne/ or points/"
    )


def chosen_positions(data: Dataset, frames: slice) -> range:
    """The positions of a drive's frames that `frames` chooses. Raises InputError where there are none."""
    positions = range(len(data))[frames]
    if not positions:
        raise InputError(f"{data.path}: no frames in that range; the drive has {len(data)}, from 0")
    return positions


def _odometry_sequences(path: Path) -> dict[str, Path]:
    """The sequence folders at or under `path` by their names."""
    if (path / "velodyne").is_dir():
        kitti = path.parent.name == "sequences" or (path / "calib.txt").exists()
        return {path.name: path} if kitti and not (path / "calib.yaml").exists() else {}
    root = path / "sequences" if (path / "sequences").is_dir() else path
    found = {folder.parent.name: folder.parent for folder in sorted(root.glob("*/velodyne"))}
    return found if root.name == "sequences" else {}


def _raw_drives(path: Path) -> dict[str, Path]:
    """The drive folders at or under `path` by their names."""
    for pattern in (".", "*", "*/*"):
        found = sorted(path.glob(f"{pattern}/velodyne_points/data"))
        if found:
            return {folder.parent.parent.name: folder.parent.parent for folder in found}
    return {}


def _pick(path: Path, found: dict[str, Path], wanted: str | None, kind: str) -> Path:
    """The one folder that is meant: by its name, its number ('4', '0005'), or by being the only one."""
    if wanted is None:
        if len(found) == 1:
            return next(iter(found.values()))
        raise InputError(f"{path}: several {kind}s; name one with --sequence: {', '.join(found)}")
    matches = [name for name in found if wanted in (name, name.removesuffix("_sync"), name.rpartition("drive_")[2])]
    matches = matches or [name for name in found if wanted.isdigit() and _number(name) == int(wanted)]
    if len(matches) == 1:
        return found[matches[0]]
    if matches:
        raise InputError(f"{path}: '{wanted}' fits several {kind}s: {', '.join(matches)}; name one in full")
    raise InputError(f"{path}: no {kind} '{wanted}'; it has {', '.join(found)}")


def _number(name: str) -> int:
    digits = name.removesuffix("_sync").rpartition("_")[2]
    return int(digits) if digits.isdigit() else -1
