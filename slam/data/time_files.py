"""Text files with the stamps of scans or images: one per line, in any unit, or a table with names or numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.files import rows_by_number
from slam.data.problem import Problem
from slam.data.stamp_digits import epoch_unit, seconds_of, seconds_of_pairs
from slam.data.stamps import mended, usual_step

TIME_FILES = ("times.txt", "timestamps.txt")
NUMBER = re.compile(r"[-+]?([0-9]+([.][0-9]*)?|[.][0-9]+)([eE][-+]?[0-9]+)?")
DATE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}[ T][0-9]{2}:[0-9]{2}:[0-9]{2}([.,][0-9]+)?Z?")
DECIMAL_COMMA, WHOLE = re.compile(r"[-+]?[0-9]+,[0-9]+"), re.compile(r"[-+]?[0-9]+")
COMMENTS = ("#", "%", "//")
Row = tuple[str, ...]  # fields of a line; empty for a line without a stamp


@dataclass(frozen=True, eq=False)
class Stamps:
    """Stamps of N files.

    Attributes:
        seconds: (N,) increasing [s].
        unit: Unit in the file: 's', 'ns', 's and ns', 'dates', ...
        problems: Stamps that were corrected.
    """

    seconds: Array
    unit: str
    problems: tuple[Problem, ...] = ()


def read_stamps(path: Path, files: Sequence[Path], numbers: Array) -> Stamps | None:
    """Read the stamps of files.

    Accepted are numbers or dates, one per line, and tables separated by commas, semicolons, tabs or blanks. Columns of
    a table are the stamp, or seconds and a fraction or count (see `seconds_of_pairs`), and the file's name or number. A
    header and decimal commas are allowed. The unit is estimated from the values. An empty line stands for a missing
    scan.

    Args:
        path: The text file.
        files: The N files of the stamps, in order.
        numbers: (N,) numbers in their names.

    Returns:
        The stamps, or None if all are equal.

    Raises:
        InputError: The file cannot be read, has another content, or does not have a row per file or number.
    """
    rows = _rows(path)
    by_name = _by_name(rows, files)
    if by_name is not None:
        rows = by_name
    values, unit, ids = _values(rows, path)
    if by_name is None:
        values = _by_number(values, ids, numbers) if ids is not None else rows_by_number(values, numbers, path)
    if usual_step(values) is None and len(values) > 1:
        return None
    seconds, problems = mended(values, path)
    return Stamps(seconds, unit, problems)


def read_rows(path: Path) -> tuple[Array, str]:
    """Read the stamps of all lines.

    Returns:
        Stamps (M,) [s], NaN for a line without a stamp, and their unit.

    Raises:
        InputError: The file cannot be read or has another content.
    """
    values, unit, _ = _values(_rows(path), path)
    return values, unit


def text_lines(path: Path) -> list[str]:
    """Read the lines of a text file, stripped, without empty lines at the end.

    The encoding is UTF-8, or UTF-16 with a byte order mark as Windows writes it.

    Raises:
        InputError: The file cannot be read or is not text.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file; one stamp per line is expected") from error
    return [line.strip() for line in text.rstrip("\n\r\t \x00").splitlines()]


def clock_rows(path: Path, lines: Sequence[str]) -> Array:
    """Parse lines like '2011-09-26 13:04:32.335337762'.

    Returns:
        (N,) datetime64[ns], NaT for empty lines.

    Raises:
        InputError: A line has another form.
    """
    try:
        return np.array([line.removesuffix("Z").replace(",", ".") or "NaT" for line in lines], "datetime64[ns]")
    except ValueError as error:
        raise InputError(f"{path}: lines like '2011-09-26 13:04:32.335337762' are expected ({error})") from error


def _rows(path: Path) -> list[Row]:
    """Fields of each line, without comments and header; empty for other lines without a number."""
    lines = [line for line in text_lines(path) if not line.startswith(COMMENTS)]
    commas = _decimal_commas(lines)
    rows = [_fields(line, commas) for line in lines]
    first = next((at for at, row in enumerate(rows) if any(_is_time(field) for field in row)), None)
    if first is None:
        fault = f"'{lines[0][:40]}' is not a stamp" if lines else "no stamps in the file"
        raise InputError(f"{path}: {fault}; one number per line is expected")
    return rows[first if any(rows[:first]) else 0 :]


def _fields(line: str, commas: bool) -> Row:
    if DATE.fullmatch(line):
        return (line,)
    if commas:
        return tuple(field.replace(",", ".") for field in re.split(r"[;\s]+", line) if field)
    parts = re.split(r"[;,\t]", line) if re.search(r"[;,\t]", line) else line.split()
    return tuple(field for part in parts if (field := part.strip().strip('"')))


def _decimal_commas(lines: Sequence[str]) -> bool:
    """Whether commas are decimal points: no field has a point, and each is a number with or without a comma.

    Two columns of whole numbers have the same form; they are recognised by a first column that is seconds since 1970,
    which `seconds_of_pairs` reads either way, or that counts.
    """
    rows = [row for line in lines if (row := re.split(r"[;\s]+", line)) and not any(map(str.isalpha, line))]
    fields = [field for row in rows for field in row if field]
    with_comma = [field.split(",") for field in fields if DECIMAL_COMMA.fullmatch(field)]
    if not with_comma or not all(DECIMAL_COMMA.fullmatch(field) or WHOLE.fullmatch(field) for field in fields):
        return False
    if len(with_comma) < len(rows) or max(map(len, rows)) > 1:
        return True
    first, second = (np.array([float(text) for text in column]) for column in zip(*with_comma, strict=True))
    pairs = epoch_unit(first) == "s" and first.min() >= 0
    return not pairs and not ((np.diff(first) == 1).all() and (np.diff(second) > 0).all() and len(first) > 1)


def _is_time(field: str) -> bool:
    return bool(NUMBER.fullmatch(field) or DATE.fullmatch(field))


def _by_name(rows: Sequence[Row], files: Sequence[Path]) -> list[Row] | None:
    """Row of each file, by its name in one of the columns; None if no column has the names."""
    stems = {file.stem: at for at, file in enumerate(files)}
    width = max(len(row) for row in rows)
    for column in range(width if width > 1 else 0):
        found: list[Row] = [()] * len(files)
        for row in rows:
            if len(row) == width and (at := stems.get(_stem(row[column]))) is not None:
                found[at] = row[:column] + row[column + 1 :]
        named = not all(NUMBER.fullmatch(row[column]) for row in rows if len(row) == width)
        if named and sum(map(bool, found)) > len(files) / 2:
            return found
    return None


def _stem(field: str) -> str:
    name = field.replace("\\", "/").rpartition("/")[2]
    return Path(name).stem if not NUMBER.fullmatch(name) else name


def _values(rows: Sequence[Row], path: Path) -> tuple[Array, str, Array | None]:
    """Stamps (M,) [s], NaN for a row without one, their unit, and the numbers (M,) in the first column, or None."""
    width = int(np.median([len(row) for row in rows if row]))
    sound = [len(row) >= width and any(_is_time(field) for field in row) for row in rows]
    kept = [row for row, good in zip(rows, sound, strict=True) if good]
    if not kept:
        raise InputError(f"{path}: no stamps in the file; one number per line is expected")
    columns = [column for column in zip(*(row[:width] for row in kept), strict=True) if all(map(_is_time, column))]
    if not columns:
        raise InputError(f"{path}: no column of numbers; one number per line is expected, the scan's stamp")
    ids = None
    if len(columns) > 1 and _are_scan_numbers(columns[0]):
        ids, columns = np.array([int(text) for text in columns[0]]), columns[1:]
    found, unit = _seconds(columns, path)
    values, spread = np.full(len(rows), np.nan), np.full(len(rows), -1)
    values[np.flatnonzero(sound)] = found
    if ids is not None:
        spread[np.flatnonzero(sound)] = ids
    return values, unit, None if ids is None else spread


def _are_scan_numbers(column: Sequence[str]) -> bool:
    """Whether these are numbers of scans: whole, increasing, mostly by one, and not times since 1970."""
    if not all(text.isdigit() for text in column):
        return False
    values = np.array([int(text) for text in column])
    steps = np.diff(values)
    return bool((steps > 0).all() and np.median(steps if len(steps) else [1]) == 1 and not epoch_unit(values))


def _seconds(columns: Sequence[Row], path: Path) -> tuple[Array, str]:
    first = columns[0]
    if DATE.fullmatch(first[0]):
        clock = clock_rows(path, first).astype(np.int64)
        return np.array([int(nanoseconds) / 10**9 for nanoseconds in clock]), "dates"
    if len(columns) > 1 and all(text.isdigit() for pair in columns[:2] for text in pair):
        whole = np.array([float(text) for text in first])
        if epoch_unit(whole) == "s" and max(map(len, columns[1])) <= 9:
            return seconds_of_pairs(first, columns[1], point=False)
    return seconds_of([int(text) if text.isdigit() else float(text) for text in first])


def _by_number(values: Array, ids: Array, numbers: Array) -> Array:
    """Stamps of the files: by the numbers in the table if these are the numbers of the files, else by order."""
    known = dict(zip(ids.tolist(), values, strict=True))
    wanted = numbers.tolist()
    if len(values) == len(wanted) and not set(wanted) <= set(known):
        return values
    return np.array([known.get(number, np.nan) for number in wanted])
