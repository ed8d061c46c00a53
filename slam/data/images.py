"""The camera's images beside the scans of a folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.files import IMAGE_SUFFIXES, SCAN_PERIOD, natural_key, numbers_of, read_times
from slam.data.problem import Problem

IMAGE_FOLDERS = ("images", "image_2")


def image_folder(path: Path) -> Path | None:
    """The folder with the images of a drive, None where there is none."""
    return next((path / name for name in IMAGE_FOLDERS if (path / name).is_dir()), None)


def match_images(
    path: Path, files: list[Path], stamps: Array, known_times: bool
) -> tuple[list[Path | None], tuple[Problem, ...]]:
    """For each scan its image: the nearest within half a scan's period, or its namesake.

    Args:
        path: The drive's folder.
        files: The N scans.
        stamps: (N,) [s].
        known_times: Whether the stamps were recorded, not assumed.

    Returns:
        The image of each scan, None where it has none, and what is wrong with the images as a whole.
    """
    folder = image_folder(path)
    if folder is None:
        return [None] * len(files), ()
    images = sorted((path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES), key=natural_key)
    times = folder / "times.txt"
    if images and times.is_file() and known_times:
        taken = read_times(times, numbers_of(images))
        nearest = np.abs(taken[:, None] - stamps).argmin(axis=0)
        period = float(np.median(np.diff(stamps))) if len(stamps) > 1 else SCAN_PERIOD
        near = np.abs(taken[nearest] - stamps) <= period / 2
        return [images[at] if close else None for at, close in zip(nearest, near, strict=True)], ()
    by_name = {path.stem: path for path in images}
    return [by_name.get(file.stem) for file in files], ()
