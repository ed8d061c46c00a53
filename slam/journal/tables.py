"""The tables of a session: their columns, and rows that are checked."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slam.data.cloud import Array

TYPES: dict[str, type] = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}
Row = Sequence[Any]


class RowError(ValueError):
    """A row is damaged."""


@dataclass(frozen=True)
class Table:
    """A table with rows numbered from 0 in the order of writing.

    Attributes:
        name: Its name.
        columns: Names and SQL types of its columns between the row's number and its checksum. A REAL may be NULL: NaN.
    """

    name: str
    columns: tuple[tuple[str, str], ...]

    @property
    def schema(self) -> str:
        """The SQL statement that creates the table."""
        columns = "".join(f", {name} {kind}" for name, kind in self.columns)
        return f"CREATE TABLE {self.name} (number INTEGER PRIMARY KEY{columns}, crc INTEGER)"

    @property
    def insertion(self) -> str:
        """The SQL statement that appends a row."""
        return f"INSERT INTO {self.name} VALUES ({', '.join('?' * (len(self.columns) + 2))})"

    def sealed(self, number: int, row: Row) -> tuple[Any, ...]:
        """Return a row with its number and checksum, as it is stored."""
        values = tuple(_kept(value) for value in row)
        return (number, *values, _checksum(number, values))

    def opened(self, number: int, stored: Row) -> tuple[Any, ...]:
        """Return the values of a stored row without number and checksum.

        Raises:
            RowError: Its number, a type or the checksum is wrong.
        """
        place, *values, crc = stored
        if place != number:
            raise RowError(f"table {self.name}: row {number} is missing")
        for value, (name, kind) in zip(values, self.columns, strict=True):
            if type(value) is not TYPES[kind] and not (value is None and kind == "REAL"):
                raise RowError(f"table {self.name}, row {number}: {name} is no {kind}")
        if crc != _checksum(number, values):
            raise RowError(f"table {self.name}, row {number}: wrong checksum")
        return tuple(math.nan if value is None else value for value in values)


FRAME = Table(
    "frame",
    (
        ("frame", "INTEGER"),  # number of the scan in the data set
        ("stamp", "REAL"),
        ("status", "TEXT"),
        ("inlier_ratio", "REAL"),
        ("points", "INTEGER"),
        ("pose", "TEXT"),
        ("covariance", "TEXT"),
        ("unobserved", "TEXT"),
        ("milliseconds", "TEXT"),
    ),
)
KEYFRAME = Table("keyframe", (("position", "INTEGER"), ("travelled", "REAL"), ("pose", "TEXT"), ("cloud", "BLOB")))
EDGE = Table("edge", (("i", "INTEGER"), ("j", "INTEGER"), ("pose", "TEXT"), ("covariance", "TEXT")))
PLACE = Table("place", (("travelled", "REAL"), ("descriptor", "BLOB")))
LOOP = Table(
    "loop",
    (
        ("i", "INTEGER"),
        ("j", "INTEGER"),
        ("distance", "REAL"),
        ("yaw", "REAL"),
        ("inlier_ratio", "REAL"),
        ("overlap", "REAL"),
        ("reason", "TEXT"),  # of the rejection; '' for a candidate that the verification accepted
        ("pose", "TEXT"),
        ("covariance", "TEXT"),
    ),
)
PROBLEM = Table("problem", (("kind", "TEXT"), ("message", "TEXT")))
OPTIMISED = Table("optimised", (("pose", "TEXT"),))  # of the keyframes, at the end of the run
DECISION = Table("decision", (("weight", "REAL"), ("status", "TEXT"), ("reason", "TEXT")))  # on loops, at the end
TABLES = {table.name: table for table in (FRAME, KEYFRAME, EDGE, PLACE, LOOP, PROBLEM, OPTIMISED, DECISION)}


def text_of(values: Array) -> str:
    """Format an array as a JSON list, nested by its axes; reading it gives the same bits."""
    return json.dumps(values.tolist())


def array_of(text: str, *shape: int) -> Array:
    """Return the array (float64) that `text_of` formatted; a length of -1 fits any.

    Raises:
        RowError: It has another shape, or a number is not finite.
    """
    try:
        values = np.array(json.loads(text), np.float64).reshape(shape)
    except (ValueError, TypeError, RecursionError) as error:
        raise RowError(f"no array of shape {shape}: {text[:40]}") from error
    if not np.isfinite(values).all():
        raise RowError(f"a number that is not finite: {text[:40]}")
    return values


def _kept(value: Any) -> Any:
    """The value that SQLite gives back: it has no NaN, and no negative zero."""
    if isinstance(value, float):
        return None if math.isnan(value) else value + 0.0
    return value


def _checksum(number: int, values: Row) -> int:
    """CRC-32 of the row's number and values, each as its bytes or as Python writes it, with its length before it."""
    crc = zlib.crc32(str(number).encode())
    for value in values:
        content = value if isinstance(value, bytes) else repr(value).encode("utf-8", "surrogatepass")
        crc = zlib.crc32(content, zlib.crc32(b"%d:" % len(content), crc))
    return crc
