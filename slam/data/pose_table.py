"""Trajectory files as tables of numbers, separated by blanks, commas or semicolons, with an optional header."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError

COMMENT = ("#", "%", "//")
EXPECTED = "a KITTI or TUM trajectory is expected"
UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Content of a trajectory file.

    Attributes:
        values: (N, C) float64.
        lines: (N,) int64, line number of each row, from 1.
        names: Names of the C columns in lower case, without units; empty without a header.
        stamp_unit: Unit of the stamps by the header [s], None if the header does not state one.
    """

    values: Array
    lines: Array
    names: tuple[str, ...] = ()
    stamp_unit: float | None = None


def read_pose_table(path: Path) -> PoseTable:
    """Read the numbers of a text file, one row per line.

    Numbers are separated by blanks, commas or semicolons; with blanks or semicolons, a comma may be the decimal point.

    Raises:
        InputError: The file is missing, empty or not text, or a line contains words or another number of values.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file; {EXPECTED}") from error
    rows: list[list[float]] = []
    lines: list[int] = []
    headers: list[str] = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.strip()
        if not content or content.startswith(COMMENT):
            headers.append(content)
            continue
        try:
            row = [float(word) for word in _words(content.partition("#")[0])]
        except ValueError as error:
            if rows:
                raise InputError(f"{path}: line {number} is not a row of numbers ({error}); {EXPECTED}") from error
            headers.append(content)
            continue
        if rows and len(row) != len(rows[0]):
            fault = f"line {number} has {len(row)} values, the lines before it {len(rows[0])}"
            raise InputError(f"{path}: {fault}; repair the line, or remove it if it is truncated")
        rows.append(row)
        lines.append(number)
    if not rows:
        words = [header for header in headers if header and not header.startswith(COMMENT)]
        fault = f"not a table of numbers, but '{words[0][:40]}'" if words else "contains no poses"
        raise InputError(f"{path}: {fault}; {EXPECTED}")
    return PoseTable(np.array(rows), np.array(lines), *_header(headers, len(rows[0])))


def _words(line: str) -> list[str]:
    if ";" in line:
        return line.replace(",", ".").split(";")
    words = line.split()
    if "," not in line:
        return words
    if len(words) > 1 and "." not in line and not any(word.startswith(",") or word.endswith(",") for word in words):
        return line.replace(",", ".").split()
    return [word for word in line.strip(", ").split(",") if word.strip() or len(words) == 1]


def _header(headers: list[str], columns: int) -> tuple[tuple[str, ...], float | None]:
    """Names of the columns and unit of the first [s], from the last header line with that many words."""
    for header in reversed(headers):
        content = header.lstrip("#%/ \t").lower()
        units = re.findall(r"[\[(]([^\])]*)[\])]", content)
        bare = re.sub(r"[\[(][^\])]*[\])]", "", content)
        names = [name.strip() for name in re.split(r"[,;]" if re.search(r"[,;]", bare) else r"\s+", bare.strip())]
        if len(names) == columns:
            return tuple(names), UNITS.get(units[0].strip()) if units else None
    return (), None
