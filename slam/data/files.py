"""Helpers of the loaders: numbered files, rows of text files, KITTI's calibration files."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.problem import Problem, spans

SCAN_PERIOD = 0.1  # s


def files_by_number(folder: Path, suffixes: Iterable[str]) -> dict[int, Path]:
    """Return the files whose names are whole numbers, by number, sorted; empty if the folder does not exist."""
    if not folder.is_dir():
        return {}
    files = [path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.stem.isascii()]
    return dict(sorted((int(path.stem), path) for path in files if path.stem.isdigit() and len(path.stem) < 19))


def natural_key(path: Path) -> list[tuple[int, str]]:
    """Return the key for natural sorting, which places scan2 before scan10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.findall(r"[0-9]+|[^0-9]+", path.name)]


def gaps(numbers: Array, folder: Path, step: int = 1) -> tuple[Problem, ...]:
    """Return a Problem that lists the numbers missing in `numbers` (N,), which should be `step` apart."""
    jumps = np.flatnonzero(np.diff(numbers) > 1.5 * step)
    if len(jumps) == 0:
        return ()
    holes = [(int(numbers[at]) + step, int(numbers[at + 1]) - step) for at in jumps]
    missing = sum(round((last - first) / step) + 1 for first, last in holes)
    text = f"{folder}: numbers missing: {spans(holes)} ({missing} in all); the rest is used"
    return (Problem("gap in numbering", text),)


def rows_by_number(rows: Array, numbers: Array, path: Path) -> Array:
    """Assign the rows of a text file to scans.

    A file has a row per existing scan, or a row per number, counted from 0 or from the first number. Rows of NaN or NaT
    stand for empty lines: they belong to missing numbers, or are ignored.

    Args:
        rows: (M, ...), one per line.
        numbers: (N,), of the scans.
        path: The file, for the message.

    Returns:
        The rows (N, ...) of the scans.

    Raises:
        InputError: The number of rows fits neither the scans nor their numbers.
    """
    if len(numbers) == 0:
        return rows[:0]
    blank, first, last = rows != rows, numbers[0], numbers[-1]
    if blank.any() and len(rows) > last and not blank[numbers].any():
        return rows[numbers]
    if blank.any() and len(rows) - int(blank.sum()) == len(numbers):
        return rows[~blank]
    if len(rows) == len(numbers):
        return rows
    if len(rows) > last:
        return rows[numbers]
    if len(rows) == last - first + 1:
        return rows[numbers - first]
    raise InputError(
        f"{path}: {len(rows)} rows for {len(numbers)} scans, the last of which is number {last}; "
        "write one row per scan, or one row per number"
    )


def read_numbers(path: Path) -> Array:
    """Read a text file with one number per line.

    Returns:
        (N,) float64.

    Raises:
        InputError: The file cannot be read, or a line is not a number.
    """
    try:
        return np.array([float(line) for line in path.read_text(encoding="utf-8").split("\n") if line.strip()])
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except ValueError as error:
        raise InputError(f"{path}: one number per line is expected ({error})") from error


def read_keyed_numbers(path: Path) -> dict[str, Array]:
    """Read a calibration file of KITTI: lines `key: number ...`; other lines (dates) are ignored.

    Raises:
        InputError: The file cannot be read.
    """
    entries = {}
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    for line in lines:
        key, _, values = line.partition(":")
        try:
            entries[key.strip()] = np.array([float(value) for value in values.split()])
        except ValueError:
            continue
    return entries


def matrix(entries: dict[str, Array], path: Path, *keys: str) -> Array:
    """Compose a 4x4 matrix from entries of a calibration file.

    Args:
        entries: By `read_keyed_numbers`.
        path: The file, for the message.
        keys: Names of the entries, 3 x n each, that form the upper rows from left to right: 'Tr' of 12 numbers, or 'R'
            of 9 and 'T' of 3.

    Raises:
        InputError: An entry is missing, not finite or of another size.
    """
    blocks = [entries.get(key, np.zeros(0)) for key in keys]
    sizes = {("Tr",): [12], ("R", "T"): [9, 3], ("R_rect_00",): [9]}.get(keys, [12])
    for key, values, size in zip(keys, blocks, sizes, strict=True):
        if len(values) != size or not np.isfinite(values).all():
            raise InputError(f"{path}: a line '{key}: ' with {size} numbers is missing; copy the file again")
    result = np.eye(4)
    rows = np.hstack([values.reshape(3, -1) for values in blocks])
    result[:3, : rows.shape[1]] = rows
    return result
