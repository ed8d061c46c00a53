"""NumPy's arrays as columns: tables of numbers and structured arrays, of .npy files or in memory; never pickles."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import BinaryIO

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import AT_ONCE, Block, Content, UnreadableError

#: The columns of a table that nobody named.
USUAL = ("x", "y", "z", "intensity")


def read_npy(file: BinaryIO, size: int, wanted: Collection[str], columns: Sequence[str] | None = None) -> Content:
    """The `wanted` columns of an .npy file of `size` bytes. See `columns_of`.

    Raises:
        UnreadableError: It is no .npy file, or an array of something else than points.
    """
    shape, by_column, kind = _header(file)
    if kind.hasobject:
        raise UnreadableError("holds Python objects, which are not read; save a plain array: np.save(file, points)")
    if kind.itemsize == 0 or min(shape, default=0) < 0:
        raise UnreadableError(f"{kind} of shape {_times(shape)} is no table of points")
    promised = math.prod(shape)
    there = min(promised, max(0, size - file.tell()) // kind.itemsize)
    if there == promised:
        table = np.frombuffer(file.read(there * kind.itemsize), kind)
        return columns_of(table.reshape(shape, order="F" if by_column else "C"), wanted, columns)
    # Cut short. A structured array has a point in each of its elements, a table `wide` numbers.
    wide = 1 if kind.names else shape[-1] if len(shape) > 1 else 0
    if not wide or (by_column and wide > 1):
        raise UnreadableError("cut short, and stored column by column: no point is whole")
    table = np.frombuffer(file.read(there // wide * wide * kind.itemsize), kind)
    content = columns_of(table if kind.names else table.reshape(-1, wide), wanted, columns)
    content.cut_short(content.count, promised // wide)
    return content


def columns_of(table: Array, wanted: Collection[str], columns: Sequence[str] | None = None) -> Content:
    """The `wanted` columns of an array: a structured one, or numbers of shape N x C or, organised, H x W x C.

    Args:
        table: The array. A structured one names its fields; those that are no single number are left out.
        wanted: The names that are of use, in lower case.
        columns: What the columns of a table without names are, '_' for none. By default x, y, z, intensity.

    Raises:
        UnreadableError: The array is of another shape or type.
    """
    if table.dtype.names and columns is not None:
        raise UnreadableError("its fields have names; leave --columns out")
    if table.size == 0:
        return Content([name.lower() for name in table.dtype.names or USUAL[:3]], 0, iter(()))
    found = dict[str, Array]()
    if table.dtype.names:
        for name in table.dtype.names:
            values = _numbers(table[name], table.ndim)
            if values is not None:
                found.setdefault(name.lower(), values)
        names = [name.lower() for name in table.dtype.names]
        organised, count = table.ndim > 1, table.size
    else:
        names = list(columns or USUAL[: table.shape[-1]]) if table.ndim else []
        if table.ndim not in (2, 3) or table.shape[-1] != len(names) or len(names) < 3 or table.dtype.kind not in "fiu":
            raise UnreadableError(_misfit(table, columns))
        found = {name: table[..., at].ravel() for at, name in enumerate(names) if name in wanted}
        organised, count = table.ndim > 2, table.size // len(names)
    content = Content(names, count, _blocks({name: found[name] for name in found if name in wanted}, count), organised)
    content.left_out([name for name in names if name in wanted and name not in found])
    return content


def _blocks(columns: Mapping[str, Array], count: int) -> Iterator[Block]:
    for start in range(0, count, AT_ONCE):
        yield {name: values[start : start + AT_ONCE] for name, values in columns.items()}


def _numbers(values: Array, dimensions: int) -> Array | None:
    """A field as (N,) numbers, dates as counts of their unit; None where it is something else."""
    if values.ndim > dimensions and values.size != math.prod(values.shape[:dimensions]):
        return None
    if values.dtype.kind in "mM":
        values = values.view(values.dtype.str[0] + "i8")
    return values.ravel() if values.dtype.kind in "fiub" else None


def _misfit(table: Array, columns: Sequence[str] | None) -> str:
    shape = f"{table.dtype} of shape {_times(table.shape)}"
    if columns is not None:
        return f"{shape}; numbers of shape N x {len(columns)} are expected: {', '.join(columns)}"
    if table.ndim == 2 and table.shape[0] in (3, 4) and table.dtype.kind in "fiu":
        return f"{shape}; N x {table.shape[0]} is expected: save points.T"
    if table.ndim == 2 and table.shape[1] > 4 and table.dtype.kind in "fiu":
        return f"{shape}; say what the columns are: --columns x,y,z,intensity,..."
    return f"{shape}; numbers of shape N x 3 or N x 4 are expected"


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape)) or "()"


def _header(file: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype]:
    try:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        return read(file)
    except Exception as error:  # NumPy raises a dozen kinds on headers that are none
        raise UnreadableError("damaged, or not an .npy file") from error
