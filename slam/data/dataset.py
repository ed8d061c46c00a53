"""Data sets as sequences of frames, and `open_dataset`, which finds the loader of a path."""

from __future__ import annotations

import re
from inspect import signature
from pathlib import Path
from typing import Any, Protocol, TypedDict, Unpack, cast

from slam.data.cloud import Array, Calibration, Frame
from slam.data.errors import InputError
from slam.data.problem import Problem
from slam.data.registry import Registry
from slam.data.sensor import Sensor


class Dataset(Protocol):
    """A sequence of N frames; `dataset[i]` reads the i-th from disk, keeps nothing, and may be called from any thread.

    Data sets of this package also have:

    - `point_times`: the interpretation of the points' times (`PointTimes`);
    - `stamps_from`: the source of the stamps;
    - `topics`: the topics in use, if the data set is a recording;
    - `scan_period`: the usual time between scans [s], and `rings`: the number of rings counted in the files, where
      these say more than the properties below;
    - `points(position)`: a scan as its file contains it;
    - `images`: the file of each scan's image, or the number of its message, or None;
    - `true_positions`: (N, 3) positions [m] of the LiDAR, NaN where unknown, if they are all that is known as ground
      truth (GNSS), or None;
    - `folders`: the folders that are read;
    - `truth_readings`: the readings of an ambiguous ground truth, if the data set is a folder (see `GroundTruth`).
    """

    @property
    def name(self) -> str:
        """Name for tables and run.json, such as 'KITTI odometry 04'."""

    @property
    def path(self) -> Path:
        """The folder or file of the sequence."""

    @property
    def sensor(self) -> Sensor | None:
        """Laser lines of the LiDAR, None if the sensor model is unknown."""

    @property
    def calibration(self) -> Calibration | None:
        """Calibration of the camera, or None."""

    @property
    def numbers(self) -> Array:
        """(N,) int64, the numbers in the file names: `Frame.index`."""

    @property
    def stamps(self) -> Array:
        """(N,) float64, strictly increasing [s]."""

    @property
    def ground_truth(self) -> Array | None:
        """(N, 4, 4) float64 T_world_lidar, the first known pose the identity, NaN where unknown; or None."""

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Problems of the data set as a whole; those of single scans are in `Frame.problems`."""

    def __len__(self) -> int: ...
    def __getitem__(self, position: int) -> Frame: ...


class Loader(Protocol):
    """A class of data sets, as DATASETS names it.

    Attributes:
        LAYOUT: The files by which the loader recognises a data set, for the message if no loader fits.
    """

    LAYOUT: str

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the sequences at or under a path, by name; none if the path is of another kind.

        A path that is a single sequence, which needs no name, gives {"": path}.
        """
        ...

    def __call__(self, path: Path, sensor: str | Path | None, **said: Any) -> Dataset:
        """Open a sequence.

        Args:
            path: The sequence, one of `sequences`.
            sensor: Overrides the sensor model of the folder (see `load_sensor`).
            **said: The options of `open_dataset` that the loader has as parameters, such as `stamp`, `point_time` and
                `columns`.
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
        "recording": "slam.data.recordings.dataset:RecordedSequence",
        "packets": "slam.data.packets.dataset:PacketSequence",
        FOLDER: "slam.data.folder:UserFolder",
    },
    "lidarlift.datasets",
)


class DatasetOptions(TypedDict, total=False):
    """Choices on how a data set is read; None, as a missing one, leaves the choice to the loader.

    Attributes:
        stamp: Instant of the sweep that the stamps refer to, 'start', 'middle' or 'end'. Default: as sensor.yaml or
            the points' times say.
        point_time: Field with the points' times, FIELD or FIELD:UNIT ('t:ns'). Default: as sensor.yaml says, or the
            first field that can be times.
        columns: Columns of the .bin or .npy scans of a folder, as in 'x,y,z,intensity,ring,time': float32, or the
            type after a colon, 't:u4'; '_' for an unused column. Default: estimated from the values.
        topic: Topic of the scans in a recording. Default: see `RecordedSequence`, as for the next two.
        image_topic: Topic of the images.
        truth_topic: Topic of the true poses.
        start: Seconds skipped at the start of a recording.
        duration: Seconds of a recording that are used.
    """

    stamp: str | None
    point_time: str | None
    columns: str | None
    topic: str | None
    image_topic: str | None
    truth_topic: str | None
    start: float | None
    duration: float | None


def open_dataset(
    path: str | Path,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    **options: Unpack[DatasetOptions],
) -> Dataset:
    """Open a sequence: of a known data set, a recording, a packet capture, or a folder of scans.

    Args:
        path: The root of a data set of DATASETS or one of its sequences (each class documents the layout); a recording,
            the file or its folder (`RecordedSequence`); a packet capture (`PacketSequence`); or a folder of scans
            (`UserFolder`).
        sequence: Name or number of the sequence, if there are several ('04'; '0005'; 'scene-0061').
        sensor: Overrides the sensor model of the folder (see `load_sensor`).
        **options: See `DatasetOptions`.

    Raises:
        InputError: No loader fits (the message says what was looked for), or the loader lacks an option that is given.
    """
    if unknown := options.keys() - DatasetOptions.__annotations__.keys():
        raise TypeError(f"open_dataset has no option {', '.join(sorted(unknown))}")
    path, loader, found = _sequences(path)
    return loader(_pick(path, found, sequence), sensor, **_taken(loader, path, options))


def sequences_in(path: str | Path) -> list[str]:
    """Return the names of the sequences at or under a path, for `sequence` in `open_dataset`.

    Returns:
        The names; [''] for a single sequence, which needs no name.

    Raises:
        InputError: There is no sequence.
    """
    return list(_sequences(path)[2])


def _sequences(path: str | Path) -> tuple[Path, Loader, dict[str, Path]]:
    """Find the absolute path, the loader of the data set at it, and its sequences by name."""
    path = Path(path).expanduser()
    if not path.exists():
        raise InputError(f"{path}: no such folder or file; name a sequence or a recording")
    path = path.resolve() if ".." in path.parts else path.absolute()  # symbolic links stay: poses/ may be beside them
    layouts = []
    for name in sorted(DATASETS.names(), key=FOLDER.__eq__):  # the folder last: it takes any scans
        loader = _loader(name)
        if found := loader.sequences(path):
            return path, loader, found
        layouts.append(loader.LAYOUT)
    if path.is_file():
        known = "a recording (.bag, .db3, .mcap) or a packet capture (.pcap, .pcapng)"
        raise InputError(f"{path}: is a file, not a folder with scans, {known}; name one of these")
    if below := [str(child) for child in sorted(path.iterdir()) if child.is_dir() and loader.sequences(child)]:
        raise InputError(f"{path}: no sequence found here, but scans in {', '.join(below[:3])}; name that folder")
    raise InputError(f"{path}: no sequence found; looked for {', '.join(layouts[:-1])} and {layouts[-1]}")


def _loader(name: str) -> Loader:
    """Import a loader. Raises InputError if it is written for lidarlift 0.2, where `sequences` was called `drives`."""
    loader = cast(Loader, DATASETS.load(name))
    if not hasattr(loader, "sequences"):
        raise InputError(
            f"data set '{name}': its loader has no method 'sequences' ('drives' until 0.2); update its package"
        )
    return loader


def _taken(loader: Loader, path: Path, options: DatasetOptions) -> dict[str, Any]:
    """Return the options that are given. Raises InputError if the loader lacks one of them."""
    given = {name: value for name, value in options.items() if value is not None}
    for name in given:
        if name not in signature(loader).parameters:
            raise InputError(f"{path}: --{name.replace('_', '-')} is not for this kind of data set; leave it out")
    return given


def ring_count(data: Dataset) -> int | None:
    """Return the number of rings of the LiDAR: its sensor model's, else counted in the first scans, None if unknown."""
    if data.sensor is not None:
        return data.sensor.ring_count
    counted: int | None = getattr(data, "rings", None)
    return counted


def chosen_positions(data: Dataset, frames: slice) -> range:
    """Return the positions of the selected frames.

    Raises:
        InputError: No frame is selected.
    """
    positions = range(len(data))[frames]
    if not positions:
        raise InputError(f"{data.path}: no frames in that range; the sequence has {len(data)}, from 0")
    return positions


def _pick(path: Path, found: dict[str, Path], wanted: str | None) -> Path:
    """Select a sequence by its name or its number ('4', '0005'), or the only one."""
    if "" in found:
        if wanted is not None:
            raise InputError(f"{path}: a single sequence, without a name such as '{wanted}'; leave --sequence out")
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
