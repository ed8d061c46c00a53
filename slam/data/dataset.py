"""A drive as a sequence of frames, and the door to all kinds of them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from inspect import signature
from pathlib import Path
from typing import Any, Protocol, cast

from slam.data.cloud import Array, Calibration, Frame
from slam.data.errors import InputError
from slam.data.problem import Problem
from slam.data.registry import Registry
from slam.data.sensor import Sensor


class Dataset(Protocol):
    """N frames of a drive; `dataset[i]` reads the i-th from disk, keeps nothing, and may be called from any thread.

    name          for tables and run.json, like 'KITTI odometry 04'
    path          the folder it was read from
    sensor        the LiDAR's laser lines, or None where nobody said which LiDAR it was
    calibration   the camera beside it, or None
    numbers       (N,) int64, the numbers in the file names: Frame.index
    stamps        (N,) float64, seconds, rising
    ground_truth  (N, 4, 4) float64 T_world_lidar, the first known one identity, NaN where unknown; or None
    problems      what is wrong with the data set as a whole; `Frame.problems` is for single scans

    Those of this package also have `point_times`, the verdict on the points' times (`PointTimes`), `stamps_from`, the
    place that stamps are from, of a recording the `topics` in use, and where they tell more than the fields above
    `scan_period` [s], the usual step between scans, and `rings`, how many the LiDAR has by the files' numbers;
    `points(position)`, a scan as its file has it; `images`, the file of each scan's image, or None; `folders` that the
    drive is read from; and a folder `truth_readings` (see `GroundTruth`).
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


class Loader(Protocol):
    """A class of data sets, as `DATASETS` names it.

    Attributes:
        LAYOUT: The files by which it is recognised, for the message where nothing fits.
    """

    LAYOUT: str

    @staticmethod
    def drives(path: Path) -> dict[str, Path]:
        """The drives at or under a path by their names; none where it is something else.

        A path that is one drive without a name to choose it by gives {"": path}.
        """
        ...

    def __call__(self, path: Path, sensor: str | Path | None, **said: Any) -> Dataset:
        """The data set of a drive; `sensor` overrides what its folder says (see `load_sensor`).

        A loader may take `stamp`, `point_time` and `columns` by name, as `open_dataset` does.
        """
        ...


FOLDER = "folder"
#: Kinds of data sets, in the order in which they are tried.
DATASETS = Registry[Dataset](
    "data set",
    {
        "kitti-odometry": "slam.data.kitti_odometry:KittiOdometry",
        "kitti-360": "slam.data.loaders.kitti_360:Kitti360",
        "kitti-raw": "slam.data.kitti_raw:KittiRaw",
        "nuscenes": "slam.data.loaders.nuscenes:NuScenes",
        "nclt": "slam.data.loaders.nclt:Nclt",
        "mulran": "slam.data.loaders.mulran:MulRan",
        "helipr": "slam.data.loaders.helipr:Helipr",
        "boreas": "slam.data.loaders.boreas:Boreas",
        "newer-college": "slam.data.loaders.newer_college:NewerCollege",
        "paris-luco": "slam.data.loaders.paris_luco:ParisLuco",
        "argoverse-2": "slam.data.loaders.argoverse_2:Argoverse2",
        "recording": "slam.data.recordings.dataset:RecordedDrive",
        "packets": "slam.data.packets.dataset:PacketDrive",
        FOLDER: "slam.data.folder:UserFolder",
    },
    "lidarlift.datasets",
)


def open_dataset(
    path: str | Path,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    *,
    stamp: str | None = None,
    point_time: str | None = None,
    columns: str | None = None,
    topic: str | None = None,
    image_topic: str | None = None,
    truth_topic: str | None = None,
    start: float | None = None,
    duration: float | None = None,
) -> Dataset:
    """The drive at a path: a data set that is known by its folders, a recording, a packet capture, a kind that another
    package adds, or a folder of scans.

    Args:
        path: The root of one of DATASETS or one of its drives (each class says how they are laid out); a recording, the
            file or its folder (`RecordedDrive`); a packet capture (`PacketDrive`); or a folder of scans of the user's
            own (`UserFolder`).
        sequence: Picks one where there are several ('04'; '0005'; 'scene-0061').
        sensor: Overrides what the folder says of the LiDAR (see `load_sensor`).
        stamp: The instant of a sweep that the stamps belong to, 'start', 'middle' or 'end'; by default sensor.yaml's
            or what the points' times tell.
        point_time: The field with the points' times, FIELD or FIELD:UNIT ('t:ns'); by default likewise.
        columns: What the numbers in the .bin or .npy scans of a folder are, as in 'x,y,z,intensity,ring,time': float32,
            or of the type behind a colon, 't:u4'; '_' for one of no use. By default the numbers have to tell.
        topic: Of a recording, the scans' topic, and
        image_topic: the images', and
        truth_topic: that of the true poses; by default found (see `RecordedDrive`).
        start: Seconds of a recording that are left out at its start, and
        duration: of those that are used.

    Raises:
        InputError: Nothing fits, the message says what was looked for; or the data set does not take an option.
    """
    said = {"stamp": stamp, "point_time": point_time, "columns": columns, "start": start, "duration": duration}
    said |= {"topic": topic, "image_topic": image_topic, "truth_topic": truth_topic}
    path, loader, found = _drives(path)
    return loader(_pick(path, found, sequence), sensor, **_taken(loader, path, said))


def drives_in(path: str | Path) -> list[str]:
    """The names of the drives at or under a path, by which `sequence` picks one; [''] for one that needs no picking.

    Raises InputError where there are none.
    """
    return list(_drives(path)[2])


def _drives(path: str | Path) -> tuple[Path, Loader, dict[str, Path]]:
    """The path made absolute, the kind of data set that is there, and its drives by their names."""
    path = Path(path).expanduser()
    if not path.exists():
        raise InputError(f"{path}: no such folder or file; name a drive")
    path = path.resolve() if ".." in path.parts else path.absolute()  # symbolic links stay: poses/ may lie beside them
    layouts = []
    for name in sorted(DATASETS.names(), key=FOLDER.__eq__):  # the folder last: it takes any scans
        loader = cast(Loader, DATASETS.load(name))
        if found := loader.drives(path):
            return path, loader, found
        layouts.append(loader.LAYOUT)
    if path.is_file():
        known = "a recording (.bag, .db3, .mcap) or a packet capture (.pcap, .pcapng)"
        raise InputError(f"{path}: is a file, not a folder with scans, {known}; name a drive")
    if below := [str(child) for child in sorted(path.iterdir()) if child.is_dir() and loader.drives(child)]:
        raise InputError(f"{path}: no drive found here, but scans in {', '.join(below[:3])}; name that folder")
    raise InputError(f"{path}: no drive found; looked for {', '.join(layouts[:-1])} and {layouts[-1]}")


def _taken(loader: Loader, path: Path, said: Mapping[str, str | float | None]) -> dict[str, Any]:
    """What is said, by the names that the loader has for it. Raises InputError where it does not know one."""
    given = {name: value for name, value in said.items() if value is not None}
    for name in given:
        if name not in signature(loader).parameters:
            raise InputError(f"{path}: --{name.replace('_', '-')} is not for this kind of data set; leave it out")
    return given


def ring_count(data: Dataset) -> int | None:
    """How many rings a data set's LiDAR has, by its sensor or counted in the first scans; None where nobody knows."""
    if data.sensor is not None:
        return data.sensor.ring_count
    counted: int | None = getattr(data, "rings", None)
    return counted


def chosen_positions(data: Dataset, frames: slice) -> range:
    """The positions of a drive's frames that `frames` chooses. Raises InputError where there are none."""
    positions = range(len(data))[frames]
    if not positions:
        raise InputError(f"{data.path}: no frames in that range; the drive has {len(data)}, from 0")
    return positions


def _pick(path: Path, found: dict[str, Path], wanted: str | None) -> Path:
    """The one folder that is meant: by its name, its number ('4', '0005'), or by being the only one."""
    if "" in found:
        if wanted is not None:
            raise InputError(f"{path}: one drive, without a sequence '{wanted}'; leave --sequence out")
        return found[""]
    if wanted is None:
        if len(found) == 1:
            return next(iter(found.values()))
        raise InputError(f"{path}: several sequences; name one with --sequence: {', '.join(found)}")
    matches = [name for name in found if wanted in (name, name.removesuffix("_sync"), name.rpartition("drive_")[2])]
    matches = matches or [name for name in found if wanted.isdigit() and _number(name) == int(wanted)]
    if len(matches) == 1:
        return found[matches[0]]
    if matches:
        raise InputError(f"{path}: '{wanted}' fits several sequences: {', '.join(matches)}; name one in full")
    raise InputError(f"{path}: no sequence '{wanted}'; it has {', '.join(found)}")


def _number(name: str) -> int:
    digits = re.search(r"[0-9]+$", name.removesuffix("_sync"))
    return int(digits[0]) if digits else -1
