"""Small YAML files of users, parsed without executing anything; faults are reported in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.yaml_text import LONGEST, parsed


def read_mapping(path: Path, known: Iterable[str]) -> dict[str, Any]:
    """Read the keys and values of a YAML file.

    Raises:
        InputError: The file cannot be read, is not a mapping, or has a key that is not `known`.
    """
    return checked_mapping(path, read_yaml(path), known)


def read_yaml(path: Path) -> Any:
    """Read a YAML file. Raises InputError if it cannot be read."""
    try:
        with path.open(encoding="utf-8") as file:
            return parsed(file.read(LONGEST + 1))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except ValueError as error:  # also for text that is not UTF-8
        raise InputError(f"{path}: not YAML ({error})") from error


def checked_mapping(path: Path, content: Any, known: Iterable[str], where: str = "") -> dict[str, Any]:
    """Check the content of a YAML file, or of a part of it, as keys and values.

    Args:
        path: The file, for messages.
        content: The parsed content.
        known: The allowed keys.
        where: Prefix of the keys in messages.

    Raises:
        InputError: As `read_mapping`.
    """
    known = sorted(known)
    if not isinstance(content, dict):
        place = f"'{where.rstrip('.')}': " if where else ""
        raise InputError(f"{path}: {place}lines like 'key: value' are expected, with the keys {', '.join(known)}")
    for key in content:
        if key not in known:
            raise InputError(f"{path}: unknown key '{where}{_short(key)}'{suggest(_short(key), known)}")
    return content


def _short(key: Any) -> str:
    return " ".join(str(key).split())[:60]


def suggest(word: str, known: Iterable[str]) -> str:
    """Return the end of an error message on an unknown word: the most similar known word, or all known words."""
    known = list(known)
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else f"; known: {', '.join(known)}"


def numbers(path: Path, key: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Convert a list of numbers to a float64 array; -1 in `shape` stands for any length.

    Raises:
        InputError: The value has another shape, or is not finite numbers.
    """
    expected = " x ".join("n" if size == -1 else str(size) for size in shape)
    try:
        array = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: '{key}' must be {expected} numbers") from error
    fits = array.ndim == len(shape) and all(want in (-1, got) for want, got in zip(shape, array.shape, strict=True))
    if not fits or not np.isfinite(array).all():
        raise InputError(f"{path}: '{key}' must be {expected} finite numbers, not of shape {array.shape}")
    return array
