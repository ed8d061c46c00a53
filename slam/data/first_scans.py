"""Format of a folder's scans, estimated from the first of them."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from slam.data.bin_layout import KITTI, Layout, parsed_columns, told_layout
from slam.data.errors import InputError
from slam.data.point_blocks import UnreadableError
from slam.data.point_files import Points, Reading, read_points
from slam.data.problem import Problem
from slam.data.sound_points import map_frame

#: Number of files that are examined.
FIRST = 3


def reading_of(files: Sequence[Path], columns: str | None = None) -> tuple[Reading, tuple[Problem, ...]]:
    """Estimate how the scans of a folder are read.

    Args:
        files: The scans, all of one kind, in their order.
        columns: Columns of .bin and .npy files as the user states them, such as 'x,y,z,intensity,ring'.

    Returns:
        The reading, and the assumptions that it makes, as problems.

    Raises:
        InputError: None of the first scans can be read, or their columns cannot be estimated; or `columns` is invalid,
            or is given for files that name their columns.
    """
    layout, told = _layout(files, columns)
    offset = first_of(files, Reading(layout)).offset
    if not any(offset):
        return Reading(layout), told
    return Reading(layout, offset), (*told, Problem("map coordinates", f"{files[0].parent}: {map_frame(offset)}"))


def first_of(files: Sequence[Path], reading: Reading) -> Points:
    """Read the first scan with points.

    Raises:
        InputError: None of the first FIRST scans can be read.
    """
    unreadable = list[Problem]()
    for path in files[:FIRST]:
        points = read_points(path, reading)
        if len(points.xyz):
            break
        unreadable += [problem for problem in points.problems if problem.kind == "missing scan"]
    if len(unreadable) == len(files[:FIRST]):
        others = f"; nor can the next {len(unreadable) - 1}" if len(unreadable) > 1 else ""
        raise InputError(unreadable[0].message.replace("; no points used", "") + others)
    return points


def _layout(files: Sequence[Path], columns: str | None) -> tuple[Layout | None, tuple[Problem, ...]]:
    suffix = files[0].suffix.lower()
    if columns is not None:
        if suffix not in (".bin", ".npy"):
            raise InputError(f"--columns {columns}: {suffix} files name their columns; leave it out")
        return parsed_columns(columns), ()
    if suffix != ".bin":
        return None, ()
    with contextlib.ExitStack() as stack:
        opened = []
        for path in files[:FIRST]:
            with contextlib.suppress(OSError):
                opened.append(stack.enter_context(path.open("rb")))
        try:
            layout = told_layout(opened)
        except UnreadableError as error:
            raise InputError(f"{files[0]}: {error}") from error
    if layout == KITTI:
        return layout, ()
    text = f"{files[0].parent}: judging by the values, a point is {layout}; if it is not, state it with --columns"
    return layout, (Problem("columns told by the numbers", text),)
