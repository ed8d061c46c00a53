"""What the loaders share: numbered files, scans in KITTI's format."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.problem import Problem, spans

SCAN_PERIOD = 0.1


def files_by_number(folder: Path, suffixes: Iterable[str]) -> dict[int, Path]:
    """The files whose names are whole numbers, in their order. Empty where there is no such folder."""
    if not folder.is_dir():
        return {}
    files = [path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.stem.isascii()]
    return dict(sorted((int(path.stem), path) for path in files if path.stem.isdigit() and len(path.stem) < 19))


def natural_key(path: Path) -> list[tuple[int, str]]:
    """Sorts scan2 before scan10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.findall(r"[0-9]+|[^0-9]+", path.name)]


def gaps(numbers: Array, folder: Path, step: int = 1) -> tuple[Problem, ...]:
    """A Problem that names the numbers missing between the first and the last of `numbers` (N,), `step` apart."""
    jumps = np.flatnonzero(np.diff(numbers) > 1.5 * step)
    if len(jumps) == 0:
        return ()
    holes = [(int(numbers[at]) + step, int(numbers[at + 1]) - step) for at in jumps]
    missing = sum(round((last - first) / step) + 1 for first, last in holes)
    text = f"{folder}: numbers missing: {spans(holes)} ({missing} in all); the rest is used"
    return (Problem("gap in numbering", text),)


def rows_by_number(rows: Array, numbers: Array, path: Path) -> Array:
    """The rows of a text file that belong to the scans `numbers` (N,): a file holds a row for every scan there is, or
    for every number, from 0 or from the first one on. Rows that are NaN or NaT, of empty lines, keep the place of a
    number that is missing, or mean nothing. Raises InputError where there is neither."""
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
        f"{path}: {len(rows)} rows for {len(numbers)} scans, the last is number {last}; "
        "a row is needed for every scan, or for every number"
    )


def read_numbers(path: Path) -> Array:
    """A text file with one number a line as (N,) float64. Raises InputError where it holds anything else."""
    try:
        return np.array([float(line) for line in path.read_text(encoding="utf-8").split("\n") if line.strip()])
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except ValueError as error:
        raise InputError(f"{path}: one number a line is expected ({error})") from error


def read_keyed_numbers(path: Path) -> dict[str, Array]:
    """KITTI's calibration files: lines `key: number ...`; lines with anything else (dates) are left out.

    Raises InputError where the file cannot be read.
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
    """(4, 4) whose upper rows are the named entries side by side, each 3 x n: 'Tr' of 12 numbers, or 'R' of 9 and 'T'
    of 3. Raises InputError where one is missing or of another size.
    """
    blocks = [entries.get(key, np.zeros(0)) for key in keys]
    sizes = {("Tr",): [12], ("R", "T"): [9, 3], ("R_rect_00",): [9]}.get(keys, [12])
    for key, values, size in zip(keys, blocks, sizes, strict=True):
        if len(values) != size or not np.isfinite(values).all():
            raise InputError(f"{path}: a line '{key}: ' with {size} numbers is needed; copy the file afresh")
    result = np.eye(4)
    rows = np.hstack([values.reshape(3, -1) for values in blocks])
    result[:3, : rows.shape[1]] = rows
    return result
