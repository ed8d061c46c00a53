"""Tables in Apache's Feather files through pyarrow, which is an extra: `pip install 'lidarlift[argoverse]'`."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any, BinaryIO

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.point_blocks import Content, UnreadableError


def read_feather(file: BinaryIO, wanted: Collection[str], path: Path) -> Content:
    """The `wanted` columns of points. Raises UnreadableError where it is no such file, InputError without pyarrow."""
    table = _columns(file, path)
    names = [name.lower() for name in table]
    block = {name.lower(): values for name, values in table.items() if name.lower() in wanted}
    count = len(next(iter(table.values()))) if table else 0
    return Content(names, count, iter([block] if count else []))


def read_table(path: Path, *names: str) -> dict[str, Array]:
    """The columns of a table by their names, all of `names` among them.

    Raises:
        InputError: The file cannot be read, or a column is missing; or pyarrow is not installed.
    """
    try:
        with path.open("rb") as file:
            table = _columns(file, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except UnreadableError as error:
        raise InputError(f"{path}: {error}; copy it afresh") from error
    missing = [name for name in names if name not in table]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}; it has {', '.join(table)}")
    return table


def _columns(file: BinaryIO, path: Path) -> dict[str, Array]:
    arrow = _pyarrow(path)
    try:
        table = arrow.read_table(file)
        return {name: table[name].to_numpy() for name in table.column_names}
    except OSError:
        raise
    except Exception as error:  # pyarrow's own, and what Python happens to raise, on files that are none
        raise UnreadableError("damaged, or not a Feather file") from error


def _pyarrow(path: Path) -> Any:
    try:
        from pyarrow import feather
    except ImportError as error:
        remedy = "pip install 'lidarlift[argoverse]'"
        raise InputError(f"{path}: .feather files are read with pyarrow, which is not installed; {remedy}") from error
    return feather
