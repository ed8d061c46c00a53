"""Text files with the stamps of scans or images: one a line, in any unit, or in a table with names or numbers."""

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
Row = tuple[str, ...]  # the fields of a line, none of one that says nothing


@dataclass(frozen=True, eq=False)
class Stamps:
    """Of N files.

    Attributes:
        seconds: (N,), rising.
        unit: What they were read as: 's', 'ns', 's and ns', 'dates'.
        problems: What was mended.
    """

    seconds: Array
    unit: str
    problems: tuple[Problem, ...] = ()


def read_stamps(path: Path, files: Sequence[Path], numbers: Array) -> Stamps | None:
    """The stamps of files in their order; None where they are all the same.

    Taken are: numbers or dates, one a line; tables with commas, semicolons, tabs or blanks, whose columns are the
    stamp, or seconds and what follows them, and beside it the file's name or number; with or without a header; decimal
    commas.
    The unit is found from what the numbers are. An empty line keeps the place of a scan that is missing.

    Args:
        path: The text file.
        files: The N files that the stamps are of.
        numbers: (N,) the numbers in their names.

    Raises:
        InputError: The file cannot be read, holds something else, or has not a row for every file or number.
    """
    rows = _rows(path)
    by_name = _by_name(rows, files)
    if by_name is not None:
        rows = by_name
    values, unit, ids = _values(rows, path)
    if by_name is None:
        values = _of_ids(values, ids, numbers) if ids is not None else rows_by_number(values, numbers, path)
    if usual_step(values) is None and len(values) > 1:
        return None
    seconds, problems = mended(values, path)
    return Stamps(seconds, unit, problems)


def read_rows(path: Path) -> tuple[Array, str]:
    """The stamps (M,) [s] of all lines, NaN where one says nothing, and their unit. Raises InputError likewise."""
    values, unit, _ = _values(_rows(path), path)
    return values, unit


def text_lines(path: Path) -> list[str]:
    """The lines of a text file, UTF-8 or what Windows writes, without blanks around, and without empty ones at the end.
    Raises InputError where it cannot be read."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: no text; times are expected, one a line") from error
    return [line.strip() for line in text.rstrip("\n\r\t \x00").splitlines()]


def clock_rows(path: Path, lines: Sequence[str]) -> Array:
    """(N,) datetime64[ns] of lines like '2011-09-26 13:04:32.335337762', NaT for empty ones. Raises InputError on
    others."""
    try:
        return np.array([line.removesuffix("Z").replace(",", ".") or "NaT" for line in lines], "datetime64[ns]")
    except ValueError as error:
        raise InputError(f"{path}: lines like '2011-09-26 13:04:32.335337762' are expected ({error})") from error


def _rows(path: Path) -> list[Row]:
    """The fields of each line; comments and the header left out, other lines without a number empty."""
    lines = [line for line in text_lines(path) if not line.startswith(COMMENTS)]
    commas = _decimal_commas(lines)
    rows = [_fields(line, commas) for line in lines]
    first = next((at for at, row in enumerate(rows) if any(_is_time(field) for field in row)), None)
    if first is None:
        example = f", not '{lines[0][:40]}'" if lines else "; it is empty"
        raise InputError(f"{path}: one number a line is expected{example}")
    return rows[first if any(rows[:first]) else 0 :]


def _fields(line: str, commas: bool) -> Row:
    if DATE.fullmatch(line):
        return (line,)
    if commas:
        return tuple(field.replace(",", ".") for field in re.split(r"[;\s]+", line) if field)
    parts = re.split(r"[;,\t]", line) if re.search(r"[;,\t]", line) else line.split()
    return tuple(field for part in parts if (field := part.strip().strip('"')))


def _decimal_commas(lines: Sequence[str]) -> bool:
    """Are commas decimal points? So they are where no field has a point and each is a number with a comma or without.

    Two columns of whole numbers look the same: the first is seconds since 1970, which `seconds_of_pairs` reads either
    way, or counts.
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
    """The row of each file, by its name in one of the columns; None where there is no such column."""
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
    """Stamps (M,) [s], NaN where a row has none, their unit, and the numbers (M,) beside them, or None."""
    width = int(np.median([len(row) for row in rows if row]))
    sound = [len(row) >= width and any(_is_time(field) for field in row) for row in rows]
    kept = [row for row, good in zip(rows, sound, strict=True) if good]
    if not kept:
        raise InputError(f"{path}: one number a line is expected")
    columns = [column for column in zip(*(row[:width] for row in kept), strict=True) if all(map(_is_time, column))]
    if not columns:
        raise InputError(f"{path}: no column of numbers in it; one number a line is expected, the scan's stamp")
    ids = None
    if len(columns) > 1 and _counts(columns[0]):
        ids, columns = np.array([int(text) for text in columns[0]]), columns[1:]
    found, unit = _seconds(columns, path)
    values, spread = np.full(len(rows), np.nan), np.full(len(rows), -1)
    values[np.flatnonzero(sound)] = found
    if ids is not None:
        spread[np.flatnonzero(sound)] = ids
    return values, unit, None if ids is None else spread


def _counts(column: Sequence[str]) -> bool:
    """Are these the numbers of scans: whole, rising, mostly by one, and no times since 1970?"""
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


def _of_ids(values: Array, ids: Array, numbers: Array) -> Array:
    """By the numbers in the table where they are those of the files, else in their order."""
    known = dict(zip(ids.tolist(), values, strict=True))
    wanted = numbers.tolist()
    if len(values) == len(wanted) and not set(wanted) <= set(known):
        return values
    return np.array([known.get(number, np.nan) for number in wanted])
