"""Protection of data sets: results are never written into their folders."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.data.dataset import Dataset


def default_folder(data: Dataset, suffix: str) -> Path:
    """Return runs/NAME-SUFFIX, with the data set's name, which a file may set, as one part of a path."""
    name = re.sub(r"[^\w.]+", "-", data.name.lower()).strip("-.") or "run"
    return Path("runs") / f"{name}-{suffix}"


def require_apart(out: Path, data: Dataset) -> None:
    """Refuse an output folder inside a data set: results would overwrite its files, or be read as part of it.

    A separate folder inside that of the sequence is allowed.

    Args:
        out: The output folder.
        data: The data set. If it has `folders`, these are protected; otherwise its `path`.

    Raises:
        InputError: `out` is a folder of the data set, also by a link, or inside a folder with its files.
    """
    target = out.expanduser().resolve()
    root = data.path.resolve()
    for folder in {path.resolve() for path in getattr(data, "folders", ())} | {root}:
        if target == folder or (folder != root and folder in target.parents):
            raise InputError(f"{out}: {folder} belongs to the data set and must not change; choose another folder")
