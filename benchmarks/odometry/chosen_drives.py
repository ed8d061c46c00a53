"""Drives of any kind on the command line: folders, simulated scenes, and towns along paths of KITTI."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.common.simulated import ALONG, SCENES, along, frame_numbers, scene
from benchmarks.odometry.drive_arguments import add_frames, as_slice
from eval.evaluation import orthonormal
from slam.data.cloud import Array, Frame
from slam.data.dataset import Dataset, chosen_positions, open_dataset
from slam.data.errors import InputError

SIMULATED = (*SCENES, *ALONG)


@dataclass(frozen=True, eq=False)
class ChosenDrive:
    """A drive and which of its frames are driven.

    name       for tables: that of the scene, or the data set's
    positions  in the data set
    simulated  whether its truth is exact
    """

    name: str
    data: Dataset
    positions: list[int]
    simulated: bool

    @property
    def truth(self) -> Array | None:
        """(N, 4, 4) of the frames that are driven, NaN where unknown; None where nothing is known."""
        return None if self.data.ground_truth is None else self.data.ground_truth[self.positions]

    @property
    def exact_truth(self) -> Array:
        """(N, 4, 4). Raises InputError where the drive is not simulated."""
        if not self.simulated or self.truth is None:
            raise InputError(f"{self.name}: its true poses are not exact; choose a simulated drive, {_names()}")
        return orthonormal(self.truth)

    @property
    def numbers(self) -> Array:
        """(N,) of the frames' files."""
        return np.asarray(self.data.numbers)[self.positions]

    def frames(self) -> Iterator[Frame]:
        """Those that are driven, read one by one."""
        return (self.data[position] for position in self.positions)


def add_drives(parser: argparse.ArgumentParser, *default: str) -> None:
    """Add SEQUENCE [SEQUENCE ...], --frames A:B and --trajectories FOLDER; `default` replaces missing sequences."""
    help_text = f"a folder, or one of {', '.join(SIMULATED)}"
    if default:
        parser.add_argument("drives", nargs="*", default=list(default), metavar="SEQUENCE",
                            help=f"{help_text}; by default {' '.join(default)}")  # fmt: skip
    else:
        parser.add_argument("drives", nargs="+", metavar="SEQUENCE", help=help_text)
    add_frames(parser, None)
    parser.add_argument("--trajectories", type=Path, metavar="FOLDER",
                        help=f"with kitti_05_ground_truth.txt and the others, for {', '.join(ALONG)}")  # fmt: skip


def chosen_drives(options: argparse.Namespace, images: bool = False) -> Iterator[ChosenDrive]:
    """The drives that were asked for, one by one; the simulated ones with `images`, if an hdl64 took them.

    Raises InputError, before any of them is opened, where there is none of a name.
    """
    for name in options.drives:
        if name not in SIMULATED and not Path(name).is_dir():
            raise InputError(f"{name}: no such folder, and no simulated drive; there are {_names()}")
    return (_opened(name, options.frames, images, options.trajectories) for name in options.drives)


def _opened(name: str, frames: str | None, images: bool, trajectories: Path | None) -> ChosenDrive:
    chosen = None if frames is None else as_slice(frames)
    if name not in SCENES:
        data = along(name, trajectories) if name in ALONG else open_dataset(name)
        positions = list(chosen_positions(data, chosen or slice(None)))
        return ChosenDrive(name if name in ALONG else data.name, data, positions, name in ALONG)
    numbers = frame_numbers(name, chosen)
    if not numbers:
        raise InputError(
            f"{name}: no frames in {frames}; the sequence has {len(frame_numbers(name, slice(None)))}, from 0"
        )
    images &= SCENES[name].settings.sensor == "hdl64"  # sparser sensors are filled in without
    data = scene(name, images or None, numbers)
    return ChosenDrive(name, data, np.flatnonzero(np.isin(data.numbers, numbers)).tolist(), True)


def _names() -> str:
    return ", ".join(SIMULATED)
