"""The file of a snapshot: an .npz archive of NumPy with one entry per array, and the structure as JSON."""

from __future__ import annotations

import json
import math
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

from slam.data.atomic import written_beside
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.journal.state import Frozen

STRUCTURE = "structure"  # the entry with the JSON text, as bytes


def write_state(path: Path, about: Mapping[str, Any], parts: Mapping[str, Frozen]) -> None:
    """Write a snapshot, on disk for certain before it has its name.

    Args:
        path: The file, with the suffix .npz.
        about: Plain values for the reader.
        parts: The frozen values by name.

    Raises:
        InputError: The file cannot be written.
    """
    structure = {"about": about, "parts": {name: [part.root, part.nodes] for name, part in parts.items()}}
    arrays = {f"{name}.{number}": values for name, part in parts.items() for number, values in enumerate(part.arrays)}
    text = np.frombuffer(json.dumps(structure).encode(), np.uint8)
    with written_beside(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **{STRUCTURE: text}, **arrays)  # type: ignore[arg-type]  # its stub names one argument
        file.flush()
        os.fsync(file.fileno())
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the name is on disk too
    finally:
        os.close(folder)


def read_state(path: Path) -> tuple[dict[str, Any], dict[str, Frozen]]:
    """Read a snapshot: what was said about it, and its parts.

    Raises:
        InputError: The file is missing or damaged.
    """
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            entries = archive.infolist()
            if sum(entry.file_size for entry in entries) > os.fstat(file.fileno()).st_size:
                raise ValueError("its entries are larger than the file")
            arrays = {entry.filename.removesuffix(".npy"): _array(archive, entry) for entry in entries}
        structure = json.loads(arrays.pop(STRUCTURE).tobytes())
        parts = {
            name: Frozen(root, nodes, [arrays[f"{name}.{number}"] for number in range(_arrays(name, arrays))])
            for name, (root, nodes) in structure["parts"].items()
        }
        return dict(structure["about"]), parts
    except Exception as error:  # zipfile and NumPy raise a dozen kinds of exceptions on damage
        raise InputError(f"{path}: missing or damaged ({type(error).__name__}: {error})") from error


def _arrays(part: str, arrays: Mapping[str, Array]) -> int:
    return sum(name.startswith(f"{part}.") for name in arrays)


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Array:
    """An array, read into memory only if the file has as many bytes as it says."""
    if entry.compress_type != zipfile.ZIP_STORED or entry.compress_size != entry.file_size:
        raise ValueError(f"{entry.filename} is packed")
    with archive.open(entry) as file:
        shape, by_column, kind = _header(file)
        if kind.kind not in "biuf" or math.prod(shape) * kind.itemsize != entry.file_size - file.tell():
            raise ValueError(f"{entry.filename} is not an array of {kind} of shape {shape}")
        values = np.frombuffer(bytearray(file.read()), kind)
    return values.reshape(shape, order="F" if by_column else "C")


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return read(file)
