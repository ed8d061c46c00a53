"""Tables of numbers without names, .bin files above all: which numbers make a point, said by the user or told by them.

Whoever writes a .bin writes what he likes, most often x, y, z, reflectance in float32 as KITTI does, but nuScenes adds
the ring, others ring and time. Of the layouts that are tried, a wrong one mixes x, y, z and the rest in each of its
columns, so that all of its columns look alike; in the right one they differ. That is measured by how much of the
variance of the numbers' ranks lies between the columns (eta squared).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.point_blocks import Columns, Content, UnreadableError

#: Numbers a point that are tried, in the order in which equals are preferred. More than 6 are not taken: nobody knows
#: what they are.
WIDTHS = (4, 3, 5, 6, 7, 8, 9, 10, 11, 12)
#: A layout that separates the columns by so much of the best is as good.
CLOSE = 0.85
#: A separation that chance does not give.
CLEAR = 0.1
#: So many points say nothing of their columns.
FEW = 20
#: What coordinates are [m], but for 0.
SMALLEST, LARGEST = 1e-9, 1e8
#: Bytes of each file that are looked at.
LOOKED_AT = 1 << 18


@dataclass(frozen=True)
class Layout:
    """The columns of a table: their names in lower case ('_' for one of no use) and types."""

    columns: tuple[tuple[str, np.dtype], ...]

    @property
    def names(self) -> list[str]:
        """The names in the order of the columns."""
        return [name for name, _ in self.columns]

    def __str__(self) -> str:
        return ", ".join(name if kind == "<f4" else f"{name}:{kind.str[1:]}" for name, kind in self.columns)


def _layout(names: Sequence[str], kind: np.dtype) -> Layout:
    return Layout(tuple((name, kind) for name in names))


KITTI = _layout(("x", "y", "z", "intensity"), np.dtype("<f4"))


def parsed_columns(text: str) -> Layout:
    """What --columns says: names with commas between, each float32 or of the type behind a colon: 'x,y,z,t:u4,_:u2'.

    Raises InputError where that is none, or has no x, y and z.
    """
    columns = []
    for word in text.split(","):
        name, _, kind = word.strip().lower().partition(":")
        if not name or (kind or "f4") not in KINDS:
            fault = f"'{word}' is no column; write names, where they are not float32 with their type"
            raise InputError(f"--columns {text}: {fault} ({', '.join(KINDS)}), as in x,y,z,t:u4")
        columns.append((name, np.dtype(f"<{kind or 'f4'}")))
    names = [name for name, _ in columns if name != "_"]
    if not {"x", "y", "z"} <= set(names) or len(set(names)) < len(names):
        raise InputError(f"--columns {text}: x, y and z must be among them, and each name once; as in x,y,z,intensity")
    return Layout(tuple(columns))


KINDS = ("f4", "f8", "u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8")


def read_bin(file: BinaryIO, size: int, wanted: Collection[str], layout: Layout) -> Content:
    """The `wanted` columns of a file of nothing but numbers."""
    places, at = {}, 0
    for name, kind in layout.columns:
        if name in wanted:
            places[name] = (at, kind)
        at += kind.itemsize
    count, left = divmod(size, at)
    content = Content(layout.names, count, Columns(places, at).binary(file, count))
    if left:
        text = f"cut short; its first {count} points are used, {left} bytes of the next are left over"
        content.faults.append(("truncated scan", text))
    return content


def told_layout(files: Iterable[BinaryIO]) -> Layout:
    """The layout of .bin files by the numbers in some of them, which stand at their beginning afterwards; KITTI's where
    there are none.

    Raises UnreadableError where none is plausible.
    """
    samples = []
    for file in files:
        size = file.seek(0, 2)
        file.seek(0)
        data = file.read(LOOKED_AT)
        file.seek(0)
        some = np.frombuffer(data, "<f4", len(data) // 4)
        if len(some) >= 3 and (np.isfinite(some) & (some != 0)).any():
            samples.append((data, size))
    layout = layout_of(samples) if samples else KITTI
    if layout is None:
        raise UnreadableError(
            "neither 3 to 6 float32 nor float64 a point are plausible; "
            "say what the numbers are: --columns x,y,z,intensity or with types: x,y,z,t:u4,ring:u2"
        )
    return layout


def layout_of(samples: Sequence[tuple[bytes, int]]) -> Layout | None:
    """The layout of .bin files, of which the first bytes and the size are given; None where none is plausible.

    Few points tell little: then it is KITTI's where that is plausible.
    """
    with np.errstate(all="ignore"):  # numbers of another layout are anything
        return _layout_of(samples)


def _layout_of(samples: Sequence[tuple[bytes, int]]) -> Layout | None:
    unclear = None
    for kind in (np.dtype("<f4"), np.dtype("<f8")):  # numbers of 8 bytes seldom look like such of 4
        scores = {width: score for width in WIDTHS if (score := _score(samples, kind, width)) is not None}
        best = max(scores.values(), default=(0.0, 0.0))
        if best[0] > CLEAR:
            width = next(width for width in WIDTHS if width in scores and scores[width][0] >= CLOSE * best[0])
            return _layout(_names(_tables(samples, kind, width)), kind) if width <= 6 else None
        whole = [width for width in WIDTHS[:4] if width in scores and scores[width][1] == 1]
        unclear = unclear or (_layout(_names(_tables(samples, kind, whole[0])), kind) if whole else None)
    return unclear


def _score(samples: Sequence[tuple[bytes, int]], kind: np.dtype, width: int) -> tuple[float, float] | None:
    """How well the columns of such a table are told apart, in most of the samples, and the share of these that hold
    whole points only; None where they are no points."""
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
    """Whether x, y and z of a table are coordinates: of usual size, none the same everywhere, seldom exactly 0."""
    xyz = table[:, :3]
    xyz = xyz[np.isfinite(xyz).all(axis=1) & xyz.any(axis=1)]
    if len(xyz) == 0:
        return False
    size = np.abs(xyz.astype(np.float64))
    odd = (size > LARGEST) | ((size < SMALLEST) & (size > 0))
    flat = len(xyz) > FEW and bool((xyz.min(axis=0) == xyz.max(axis=0)).any())
    return bool(odd.mean() < 0.1) and not flat and bool((xyz == 0).any(axis=1).mean() < 0.5 or len(xyz) <= FEW)


def _separation(table: Array) -> float:
    """How much of the variance of the numbers' ranks lies between the columns, 0..1, less what chance gives."""
    rows, width = table.shape
    there = np.isfinite(table) & (table != 0)  # zeros are points without return
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
    """Each number's rank among all, the same for equal ones."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - count / 2)[place])


def _names(table: Array) -> list[str]:
    """The names of columns: x, y, z, intensity, then ring for small whole numbers and time for others."""
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
