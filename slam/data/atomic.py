"""Atomic writing of files: no half-written file has a final name."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from slam.data.errors import InputError


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder, with the same suffix; on success it is renamed to `path`.

    Raises:
        InputError: The disk is full or the folder is not writable.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.unlink(missing_ok=True)  # a link by this name must not be followed
        yield temporary
        temporary.replace(path)
    except OSError as error:
        fault = f"cannot be written ({error.strerror or error})"
        raise InputError(f"{path}: {fault}; free space or choose another folder") from error
    finally:
        if temporary.parent.is_dir():
            temporary.unlink(missing_ok=True)


def remove_temporaries(folder: Path, names: Iterable[str]) -> None:
    """Remove what `written_beside` left of files with these names in a folder when a program was killed."""
    patterns = [rf"\.{re.escape(Path(name).stem)}\.[0-9]+{re.escape(Path(name).suffix)}" for name in names]
    for path in folder.iterdir() if folder.is_dir() else ():
        if any(re.fullmatch(pattern, path.name) for pattern in patterns):
            with suppress(OSError):
                path.unlink()


def require_writable(folder: Path) -> None:
    """Check that `folder` is a writable folder or can be created; nothing is created yet.

    Raises:
        InputError: It is neither.
    """
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise InputError(f"{folder}: {existing} is not a writable folder; choose another folder")


def require_no_links(folder: Path, names: Iterable[str]) -> None:
    """Check that none of the folders with these names in `folder` is a link: results would be written outside.

    Links in place of files need no check: a new file takes their place.

    Raises:
        InputError: One is.
    """
    for name in names:
        if (folder / name).is_symlink():
            raise InputError(f"{folder / name}: is a link; remove it, or choose another folder")


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file atomically.

    Raises:
        InputError: The file cannot be written.
    """
    with written_beside(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
