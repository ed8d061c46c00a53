"""Trajectory files as tables of numbers: commas or blanks between them, and a header that may name the columns."""

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
    """What a trajectory file has in it.

    Attributes:
        values: (N, C) float64.
        lines: (N,) int64, the line of the file that each row stands in, from 1.
        names: Of the C columns in lower case, without units; empty where no header names them.
        stamp_unit: Seconds that the header's unit of the stamps stands for, None where it gives none.
    """

    values: Array
    lines: Array
    names: tuple[str, ...] = ()
    stamp_unit: float | None = None


def read_pose_table(path: Path) -> PoseTable:
    """The numbers of a text file, one row a line.

    Between them stand blanks, commas or semicolons; with blanks or semicolons, a comma may be the decimal point.

    Raises:
        InputError: The file is missing, empty or no text, or a line has words in it or another number of values.
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
                raise InputError(f"{path}: line {number} is no row of numbers ({error}); {EXPECTED}") from error
            headers.append(content)
            continue
        if rows and len(row) != len(rows[0]):
            fault = f"line {number} has {len(row)} values, those before it {len(rows[0])}"
            raise InputError(f"{path}: {fault}; is it cut short? Repair or remove the line")
        rows.append(row)
        lines.append(number)
    if not rows:
        words = [header for header in headers if header and not header.startswith(COMMENT)]
        fault = f"not a table of numbers, but '{words[0][:40]}'" if words else "no poses in it"
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
    """The names of the columns, and the unit of the first, by the last header line that has as many words."""
    for header in reversed(headers):
        content = header.lstrip("#%/ \t").lower()
        units = re.findall(r"[\[(]([^\])]*)[\])]", content)
        bare = re.sub(r"[\[(][^\])]*[\])]", "", content)
        names = [name.strip() for name in re.split(r"[,;]" if re.search(r"[,;]", bare) else r"\s+", bare.strip())]
        if len(names) == columns:
            return tuple(names), UNITS.get(units[0].strip()) if units else None
    return (), None
