"""Points and words for tiny data sets of others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.cloud import Array

Writer = Callable[..., None]


@pytest.fixture
def write_struct() -> Writer:
    """`write_struct(file, "x:f4,y:f4,z:f4,t:u4", rows)`: points one after another, as a C program writes them."""

    def write(file: Path, columns: str, rows: Array) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        table = np.zeros(
            len(rows), [(name, f"<{kind}") for name, kind in (word.split(":") for word in columns.split(","))]
        )
        for name, values in zip(table.dtype.names or (), np.transpose(rows), strict=True):
            table[name] = values
        table.tofile(file)

    return write


@pytest.fixture
def write_text() -> Writer:
    """`write_text(file, row, row)`: a line for each row, with commas between its values."""

    def write(file: Path, *rows: object, separator: str = ",") -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        lines = [row if isinstance(row, str) else separator.join(map(str, np.ravel(row))) for row in rows]  # type: ignore[arg-type]
        file.write_text("".join(f"{line}\n" for line in lines))

    return write
