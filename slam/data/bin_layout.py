"""Column layout of files without a header, above all .bin: stated by the user or estimated from the values.

The format .bin has no header. Most files hold float32 x, y, z and reflectance as KITTI's do; nuScenes adds the ring,
others ring and time. A wrong layout mixes x, y, z and the other fields in each of its columns, so that all columns have
similar distributions; in the right layout the distributions differ. The difference is measured by the share of the
variance of the values' ranks that lies between the columns (eta squared).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.point_blocks import Columns, Content, UnreadableError

#: Values per point that are tried, the first preferred among equals. A layout of more than 6 is not used: the meaning
#: of its columns is unknown.
WIDTHS = (4, 3, 5, 6, 7, 8, 9, 10, 11, 12)
#: Share of the best separation from which a layout counts as equally good.
CLOSE = 0.85
#: Separation that does not occur by chance.
CLEAR = 0.1
#: Number of points up to which no separation can be measured.
FEW = 20
#: Range of plausible coordinates [m], apart from 0.
SMALLEST, LARGEST = 1e-9, 1e8
#: Bytes that are examined per file, and values of them whose ranks are compared.
EXAMINED, RANKED = 1 << 18, 1 << 14


@dataclass(frozen=True)
class Layout:
    """Columns of a table: names in lower case ('_' for an unused column) and types."""

    columns: tuple[tuple[str, np.dtype], ...]

    @property
    def names(self) -> list[str]:
        """Column names, in order."""
        return [name for name, _ in self.columns]

    def __str__(self) -> str:
        return ", ".join(name if kind == "<f4" else f"{name}:{kind.str[1:]}" for name, kind in self.columns)


def _layout(names: Sequence[str], kind: np.dtype) -> Layout:
    return Layout(tuple((name, kind) for name in names))


KITTI = _layout(("x", "y", "z", "intensity"), np.dtype("<f4"))


def parsed_columns(text: str) -> Layout:
    """Parse the value of --columns: names separated by commas, float32 or of the type after a colon: 'x,y,z,t:u4,_:u2'.

    Raises:
        InputError: A column is not of this form, a name is repeated, or x, y or z is missing.
    """
    columns = []
    for word in text.split(","):
        name, _, kind = word.strip().lower().partition(":")
        if not name or (kind or "f4") not in KINDS:
            fault = f"'{word}' is not a column; write NAME, or NAME:TYPE if the type is not float32"
            raise InputError(f"--columns {text}: {fault} ({', '.join(KINDS)}), as in x,y,z,t:u4")
        columns.append((name, np.dtype(f"<{kind or 'f4'}")))
    names = [name for name, _ in columns if name != "_"]
    if not {"x", "y", "z"} <= set(names) or len(set(names)) < len(names):
        fault = "x, y and z are required, and each name once"
        raise InputError(f"--columns {text}: {fault}; write for example x,y,z,intensity")
    return Layout(tuple(columns))


KINDS = ("f4", "f8", "u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8")


def read_bin(file: BinaryIO, size: int, wanted: Collection[str], layout: Layout) -> Content:
    """Read the `wanted` columns of a file without a header, of `size` bytes."""
    places, at = {}, 0
    for name, kind in layout.columns:
        if name in wanted:
            places[name] = (at, kind)
        at += kind.itemsize
    count, left = divmod(size, at)
    content = Content(layout.names, count, Columns(places, at).binary(file, count))
    if left:
        text = f"truncated; the first {count} points are used, the {left} bytes after them are left out"
        content.faults.append(("truncated scan", text))
    return content


def told_layout(files: Iterable[BinaryIO]) -> Layout:
    """Estimate the layout of .bin files from some of them; each is left at its beginning.

    Returns:
        The layout; KITTI's if the files hold no finite value but 0.

    Raises:
        UnreadableError: No layout is plausible.
    """
    samples = []
    for file in files:
        size = file.seek(0, 2)
        file.seek(0)
        data = file.read(EXAMINED)
        file.seek(0)
        some = np.frombuffer(data, "<f4", len(data) // 4)
        if len(some) >= 3 and (np.isfinite(some) & (some != 0)).any():
            samples.append((data, size))
    layout = layout_of(samples) if samples else KITTI
    if layout is None:
        raise UnreadableError(
            "neither 3 to 6 float32 nor 3 to 6 float64 values per point are plausible; "
            "state the columns: --columns x,y,z,intensity or with types: x,y,z,t:u4,ring:u2"
        )
    return layout


def layout_of(samples: Sequence[tuple[bytes, int]]) -> Layout | None:
    """Estimate the layout of .bin files.

    Few points do not separate the columns: KITTI's layout is then preferred if it is plausible.

    Args:
        samples: First bytes and size in bytes of each file.

    Returns:
        The layout, or None if none is plausible.
    """
    with np.errstate(all="ignore"):  # bytes that are read by a wrong layout give any value
        return _layout_of(samples)


def _layout_of(samples: Sequence[tuple[bytes, int]]) -> Layout | None:
    unclear = None
    for kind in (np.dtype("<f4"), np.dtype("<f8")):  # float64 values are seldom plausible as float32
        scores = {width: score for width in WIDTHS if (score := _score(samples, kind, width)) is not None}
        best = max(scores.values(), default=(0.0, 0.0))
        if best[0] > CLEAR:
            width = next(width for width in WIDTHS if width in scores and scores[width][0] >= CLOSE * best[0])
            return _layout(_names(_tables(samples, kind, width)), kind) if width <= 6 else None
        whole = [width for width in WIDTHS[:4] if width in scores and scores[width][1] == 1]
        unclear = unclear or (_layout(_names(_tables(samples, kind, whole[0])), kind) if whole else None)
    return unclear


def _score(samples: Sequence[tuple[bytes, int]], kind: np.dtype, width: int) -> tuple[float, float] | None:
    """Separation of the columns, and the share of the files that hold complete points only.

    None if most of the samples are not plausible points in this layout.
    """
    tables = [(_table(data, kind, width), size) for data, size in samples]
    fit = [(table, size) for table, size in tables if _plausible(table)]
    if 2 * len(fit) <= len(samples):
        return None
    whole = float(np.mean([size % (kind.itemsize * width) == 0 for _, size in fit]))
    return float(np.mean([_separation(table) for table, _ in fit])) * (1 + whole), whole


def _tables(samples: Sequence[tuple[bytes, int]], kind: np.dtype, width: int) -> Array:
    return np.concatenate([table for data, _ in samples if _plausible(table := _table(data, kind, width))])


def _table(data: bytes, kind: np.dtype, width: int) -> Array:
    return np.frombuffer(data, kind, len(data) // (kind.itemsize * width) * width).reshape(-1, width)


def _plausible(table: Array) -> bool:
    """Whether x, y and z are plausible coordinates: of usual size, none constant, seldom exactly 0."""
    xyz = table[:, :3]
    xyz = xyz[np.isfinite(xyz).all(axis=1) & xyz.any(axis=1)]
    if len(xyz) == 0:
        return False
    size = np.abs(xyz.astype(np.float64))
    odd = (size > LARGEST) | ((size < SMALLEST) & (size > 0))
    flat = len(xyz) > FEW and bool((xyz.min(axis=0) == xyz.max(axis=0)).any())
    return bool(odd.mean() < 0.1) and not flat and bool((xyz == 0).any(axis=1).mean() < 0.5 or len(xyz) <= FEW)


def _separation(table: Array) -> float:
    """Share of the variance of the values' ranks that lies between the columns (eta squared), corrected for chance.

    The sum over the values, their magnitudes and whether they are whole, each at most 1.
    """
    table = table[: RANKED // table.shape[1]]
    rows, width = table.shape
    there = np.isfinite(table) & (table != 0)  # zeros are points without a return
    columns = np.broadcast_to(np.arange(width), table.shape)[there]
    counts = np.bincount(columns, minlength=width)
    if rows <= FEW or len(columns) <= FEW * width:
        return 0.0
    found = 0.0
    for values in (table[there], np.abs(table[there]), table[there] % 1 == 0):
        ranks = _ranks(values)
        means = np.bincount(columns, ranks, width) / np.maximum(counts, 1)
        spread = ranks.var()
        if spread > 0:
            between = float(np.sum(counts * (means - ranks.mean()) ** 2) / (len(ranks) * spread))
            found += 1 - (1 - between) * (len(ranks) - 1) / (len(ranks) - width)
    return found


def _ranks(values: Array) -> Array:
    """Rank of each value, the same for equal values."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - count / 2)[place])


def _names(table: Array) -> list[str]:
    """Column names: x, y, z, intensity, then 'ring' for small whole numbers and 'time' for others."""
    names = ["x", "y", "z", "intensity"][: table.shape[1]]
    for values in table[:, 4:].T:
        values = values[np.isfinite(values)]
        whole = len(values) > 0 and bool((values % 1 == 0).all())
        if len(values) == 0 or values.min() == values.max():
            name = "_"
        elif whole and values.min() >= 0 and values.max() < 1024:
            name = "ring"
        else:
            name = "time"
        names.append("_" if name in names else name)
    return names
