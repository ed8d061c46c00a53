"""Results never go where the data come from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.data.dataset import Dataset


def require_apart(out: Path, data: Dataset) -> None:
    """Refuse to write into a data set: results would take the place of its files, or be taken for some of them.

    A folder of one's own inside the drive's is allowed.

    Args:
        out: The folder that is to be written.
        data: What is read. Where it has `folders`, these are refused; else its `path` alone.

    Raises:
        InputError: `out` is one of its folders, by whatever name or link, or lies inside one that holds its files.
    """
    place = out.expanduser().resolve()
    drive = data.path.resolve()
    for folder in {path.resolve() for path in getattr(data, "folders", ())} | {drive}:
        if place == folder or (folder != drive and folder in place.parents):
            raise InputError(f"{out}: the drive is read from {folder}, where nothing may change; choose another folder")
