"""No half-written file ever stands under a final name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slam.data.errors import InputError


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A name to write to, in the same folder and with the same suffix; it becomes `path` when all has gone well.

    Raises InputError where the disk is full or the folder cannot be written.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        if temporary.parent.is_dir():
            temporary.unlink(missing_ok=True)


def require_writable(folder: Path) -> None:
    """Raise InputError where `folder` is none or cannot be made; nothing is made yet."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise InputError(f"{folder}: {existing} is no folder that can be written to; choose another")


def write_text(path: Path, text: str) -> None:
    """Text to a file, whole or not at all."""
    with written_beside(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
