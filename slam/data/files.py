"""What the loaders share: numbered files, scans in KITTI's format."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.problem import Problem, spans

#: No LiDAR sees farther [m]: larger coordinates come from damaged files.
FARTHEST = 1e4
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


def numbers_of(files: list[Path]) -> Array:
    """(N,) int64: the last number in each name where these rise, else 0, 1, ..."""
    found = [[text for text, _ in natural_key(Path(file.stem)) if text >= 0] for file in files]
    numbers = [digits[-1] for digits in found if digits]
    rising = all(before < after for before, after in pairwise(numbers))
    if len(numbers) == len(files) and rising and numbers[-1] < 2**63:
        return np.array(numbers, np.int64)
    return np.arange(len(files))


def read_times(path: Path, numbers: Array) -> Array:
    """Stamps (N,) [s] of the files `numbers` (N,). Raises InputError where they do not rise or are not seconds."""
    times = rows_by_number(read_numbers(path), numbers, path)
    steps = np.diff(times)
    if not (np.isfinite(times).all() and (steps > 0).all()):
        raise InputError(f"{path}: times must rise from line to line; repair line {int(np.argmin(steps > 0)) + 2}")
    if len(steps) and np.median(steps) > 100:
        raise InputError(f"{path}: {np.median(steps):g} s from scan to scan; give seconds, not milli- or nanoseconds")
    return times


def gaps(numbers: Array, folder: Path, step: int = 1) -> tuple[Problem, ...]:
    """A Problem that names the numbers missing between the first and the last of `numbers` (N,), `step` apart."""
    jumps = np.flatnonzero(np.diff(numbers) > 1.5 * step)
    if len(jumps) == 0:
        return ()
    holes = [(int(numbers[at]) + step, int(numbers[at + 1]) - step) for at in jumps]
    missing = sum(round((last - first) / step) + 1 for first, last in holes)
    text = f"{folder}: numbers missing: {spans(holes)} ({missing} in all); the rest is used"
    return (Problem("gap in numbering", text),)


def read_bin(path: Path) -> tuple[Array, Array, tuple[Problem, ...]]:
    """Points (N, 3) and reflectance (N,), float32, of a file of float32 x, y, z [m], reflectance; and its problems.

    What is damaged is left out and reported: bytes after the last whole point, points that are not finite. A file
    that cannot be read or holds nothing gives no points.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        problem = Problem("missing scan", f"{path}: cannot be read ({error.strerror or error}); no points used")
        return np.zeros((0, 3), np.float32), np.zeros(0, np.float32), (problem,)
    problems: list[Problem] = []
    whole, left = divmod(len(data), 16)
    if left:
        text = f"{path}: cut short; its first {whole} points are used, {left} bytes of the next are left over"
        problems.append(Problem("truncated scan", text))
    points = np.frombuffer(data, np.float32, 4 * whole).reshape(-1, 4)
    sound, found = sound_points(path, points[:, :3])
    if found:
        points = points[sound]
    if len(points) == 0:
        problems.append(Problem("empty scan", f"{path}: no points in it"))
    intensity = np.ascontiguousarray(points[:, 3])
    if not np.isfinite(intensity.sum()):
        intensity = np.nan_to_num(intensity)
    return np.ascontiguousarray(points[:, :3]), intensity, (*problems, *found)


def sound_points(path: Path, xyz: Array) -> tuple[Array, tuple[Problem, ...]]:
    """Which of the points (N, 3) are finite and in this world, (N,) bool, and a Problem that counts the others."""
    if len(xyz) == 0 or np.abs(xyz).max() < FARTHEST:  # false where there is a NaN
        return np.ones(len(xyz), bool), ()
    sound = np.asarray((np.abs(xyz) < FARTHEST).all(axis=1))
    bad = len(sound) - int(np.count_nonzero(sound))
    text = f"{path}: {bad} of {len(xyz)} points are not finite, or farther than {FARTHEST / 1000:g} km; left out"
    return sound, (Problem("non-finite points", text),)


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
