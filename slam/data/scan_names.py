"""Scan files of a folder: their order, numbers and stamps, by their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.files import natural_key
from slam.data.point_files import SUFFIXES
from slam.data.problem import Problem
from slam.data.stamp_digits import PER_SECOND, epoch_unit, seconds_of_pairs, unevenness
from slam.data.stamps import mended, usual_step

SCAN_FOLDERS = ("scans", "velodyne", "points", "lidar", ".")
#: Point files that a run writes into its folder.
OWN = ("map.pcd",)
COUNTED = 10**4  # minimum median step between numbers that are stamps in us,
COUNTED_NS = 10**7  # and in ns
LEAST_DECIMALS = 3  # minimum digits after a point for decimal seconds without other evidence;
EVEN = 0.2  # fewer digits are accepted if the `unevenness` of the stamps is below this
DATE = re.compile(
    r"(?<![0-9])(20[0-9]{2})[-_.]?([01][0-9])[-_.]?([0-3][0-9])[-_T ]?"
    r"([0-2][0-9])[-_.:h]?([0-5][0-9])[-_.:m]?([0-6][0-9])[-_.s]?([0-9]{1,9})?"
)


@dataclass(frozen=True, eq=False)
class ScanNames:
    """N scan files in order.

    Attributes:
        files: Paths.
        numbers: (N,) int64, the last number in each name if these increase, else 0, 1, ...
        stamps: (N,) [s] if the names are stamps, else None.
        unit: Unit of the stamps in the names: 'ns', 's and ns', 'dates', ...
    """

    files: list[Path]
    numbers: Array
    stamps: Array | None = None
    unit: str = ""


def scans_in(path: Path) -> list[Path]:
    """Return the scan files of a folder, or of one of its SCAN_FOLDERS, in order; empty if there are none.

    Hidden files are excluded, since macOS writes `._000000.bin` beside a file; so is the map of a run.
    """
    return named_scans(path).files


def named_scans(path: Path) -> ScanNames:
    """Return the scan files as `scans_in` does, with the numbers and stamps in their names."""
    for folder in (path / name for name in SCAN_FOLDERS):
        if folder.is_dir():
            files = [file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES]
            files = [file for file in files if not file.name.startswith(".") and file.name not in OWN]
            if files:
                return in_order(files)
    return ScanNames([], np.zeros(0, np.int64))


def in_order(files: Sequence[Path], unit: str | None = None) -> ScanNames:
    """Sort files, scans or images, by the stamps or the numbers in their names.

    `unit` states that names which are whole numbers are stamps in 's', 'ms', 'us' or 'ns'; by default it is estimated
    from the names.
    """
    files = sorted(files, key=natural_key)
    stems = [_stem(file) for file in files]
    if unit and all(stem.isascii() and stem.isdigit() for stem in stems):
        found: tuple[Array, str] | None = np.array([int(stem) / PER_SECOND[unit] for stem in stems]), unit
    else:
        found = _stamps_of(stems)
    if found is None:
        return ScanNames(files, numbers_of(files))
    stamps, unit = found
    order = np.argsort(stamps, kind="stable")
    return ScanNames([files[at] for at in order], np.arange(len(files)), stamps[order], unit)


def stamps_of_names(path: Path, scans: ScanNames) -> tuple[Array | None, str, tuple[Problem, ...]]:
    """Return the stamps in the names of scans.

    Args:
        path: Folder, for messages.
        scans: The scans.

    Returns:
        Increasing stamps (N,) [s], or None if the names are not stamps; their source; and problems of what was mended.
    """
    if scans.stamps is None or (usual_step(scans.stamps) is None and len(scans.files) > 1):
        return None, "assumed", ()
    stamps, problems = mended(scans.stamps, f"{path}: names")
    return stamps, f"the scans' names, {scans.unit}", problems


def numbers_of(files: Sequence[Path]) -> Array:
    """Return the last number in each name that is not the same in all, if these increase, else 0, 1, ... (N,) int64."""
    columns = _varying(_digits([_stem(file) for file in files]))
    numbers = [int(text) for text in columns[-1]] if columns else [int(number) for number in _last_numbers(files)]
    rising = all(before < after for before, after in pairwise(numbers))
    if len(numbers) == len(files) and rising and numbers and numbers[-1] < 2**63:
        return np.array(numbers, np.int64)
    return np.arange(len(files))


def _last_numbers(files: Sequence[Path]) -> list[str]:
    """The last number of each name that has one, for names without a common pattern."""
    return [found[-1] for file in files if (found := re.findall(r"[0-9]+", _stem(file)))]


def _stem(file: Path) -> str:
    """The name without its suffix; names of nuScenes end in .pcd.bin."""
    stem = Path(file.stem)
    return stem.stem if stem.suffix.lower() in SUFFIXES else file.stem


def _digits(stems: Sequence[str]) -> list[tuple[str, ...]]:
    """The numbers in names of a common pattern: N texts for each place; empty without a common pattern."""
    if len({re.sub(r"[0-9]+", "0", stem) for stem in stems}) != 1:
        stems = [stem if "." in stem else f"{stem}.0" for stem in stems]  # 17 among 16.9 and 17.1
        if not all(re.fullmatch(r"[0-9]+\.[0-9]+", stem) for stem in stems):
            return []
    return list(zip(*(re.findall(r"[0-9]+", stem) for stem in stems), strict=True))


def _varying(columns: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """The columns without the last ones that are the same in all names."""
    while len(columns) > 1 and len(set(columns[-1])) == 1 and len(columns[-1]) > 1:
        columns = columns[:-1]
    return columns


def _stamps_of(stems: Sequence[str]) -> tuple[Array, str] | None:
    """Stamps (N,) [s] and their unit; None if the names are not stamps."""
    columns = _varying(_digits(stems))
    if not columns:
        return None
    if (dates := _dates(stems)) is not None:
        return dates, "dates"
    separators = re.findall(r"(?<=[0-9])[^0-9]+(?=[0-9])", stems[0])
    if len(columns) > 1:
        whole, part, separator = columns[-2], columns[-1], separators[len(columns) - 2]
        if _are_decimal_seconds(whole, part, separator):
            return seconds_of_pairs(whole, part, separator == ".")
    values = [int(text) for text in columns[-1]]
    unit = _unit(np.array(values, np.float64))
    return (np.array([value / PER_SECOND[unit] for value in values]), unit) if unit else None


def _are_decimal_seconds(whole: Sequence[str], part: Sequence[str], separator: str) -> bool:
    """Whether these are seconds and their fraction, not two other numbers."""
    if epoch_unit(np.array([float(text) for text in whole])) == "s":
        return separator in (".", "_", "-")
    if separator != ".":
        return False
    if max(len(text) for text in part) >= LEAST_DECIMALS:
        return True
    stamps = np.sort([float(f"{a}.{b}") for a, b in zip(whole, part, strict=True)])
    return len(set(whole)) > 1 and unevenness(stamps) < EVEN


def _dates(stems: Sequence[str]) -> Array | None:
    """Seconds since 1970 (N,) of names that all have a different date and time of day, else None."""
    found = [DATE.search(stem) for stem in stems]
    try:
        texts = ["{}-{}-{}T{}:{}:{}.{}".format(*match.groups("0")) for match in found if match]
        dates = np.array(texts, "datetime64[ns]")
    except ValueError:  # a 13th month
        return None
    if len(dates) < len(stems) or len(np.unique(dates)) < len(stems):
        return None
    return np.array([int(nanoseconds) / 10**9 for nanoseconds in dates.astype(np.int64)])


def _unit(values: Array) -> str | None:
    """Unit of whole numbers (N,) that are stamps: times since 1970, or with steps too large for frame numbers."""
    unit, steps = epoch_unit(values), np.diff(np.sort(values))
    if unit:
        return unit
    step = float(np.median(steps)) if len(steps) > 1 else 0.0
    if step < COUNTED:
        return None
    return "us" if step < COUNTED_NS else "ns"
