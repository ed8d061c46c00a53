"""`lidarlift info`: the content of a data set, and the command to run it."""

from __future__ import annotations

import json
import shlex
import shutil
import textwrap
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import DatasetArgument
from lidarlift.cli.data_options import DataOptions, with_data_options

if TYPE_CHECKING:
    from lidarlift.inspecting import Info

LABEL_WIDTH, MAX_WIDTH = 14, 120  # characters


@with_data_options
def info(
    dataset: DatasetArgument,
    reading: DataOptions,
    every_scan: Annotated[bool, typer.Option("--all", help="Read all scans, not only a dozen.")] = False,
    json_: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show the content of a data set: scans, rate, rings, fields, times, camera, ground truth, gaps, and how to run it.

    Example: `lidarlift info my_sequence`

    For a folder with several sequences, they are listed; `--sequence` selects one.
    """
    from lidarlift.inspecting import info as inspect_data_set
    from slam.data.dataset import sequences_in

    names = sequences_in(dataset)
    if reading.sequence is None and len(names) > 1 and not json_:
        print(_several(dataset, names))
        return
    found = inspect_data_set(
        dataset, sequence=reading.sequence, sensor=reading.sensor, every_scan=every_scan, **reading.said()
    )
    print(json.dumps(asdict(found), indent=2, default=str) if json_ else page(found))


def page(info: Info) -> str:
    """Return the description of a data set, as wide as the terminal."""
    rows = {
        "scans": _scans(info),
        "stamps": _stamps(info),
        "points": _points(info),
        "fields": ", ".join(info.fields),
        "rings": f"{info.rings}, {info.rings_from}" if info.rings else info.rings_from,
        "point times": info.point_times,
        "LiDAR": _lidar(info),
        "camera": _camera(info),
        "ground truth": _truth(info),
    }
    lines = [f"{info.name}  ({info.path})", ""]
    lines += [line for label, value in rows.items() if value for line in _row(label, value)]
    lines += _topics(info)
    if info.problems:
        lines += ["", "Problems and assumptions:"]
        for kind, count, message in info.problems:
            text = message.removeprefix(f"{info.path}: ").replace(f"{info.path}/", "")
            lines += _wrapped(f"{kind}{f' ({count} times)' if count > 1 else ''}: {text}", "  - ", "    ")
    lines += ["", "To run SLAM:", *(f"  {command}" for command in info.commands)]
    return "\n".join(lines)


def _topics(info: Info) -> list[str]:
    """A table of a recording's topics."""
    if not info.topics:
        return []
    kinds = [topic.type.rpartition("/msg/")[2] for topic in info.topics]
    widths = max(len(topic.name) for topic in info.topics), max(map(len, kinds))
    lines = ["", "Topics:"]
    for topic, kind in zip(info.topics, kinds, strict=True):
        gap = f"longest gap {topic.longest_gap_s:.3g} s" if topic.longest_gap_s else ""
        notes = ", ".join(note for note in (topic.use, gap) if note)
        rate = f"{topic.rate_hz:.3g} Hz" if topic.rate_hz else ""
        line = f"  {topic.name:{widths[0]}}  {kind:{widths[1]}}  {topic.messages:8,}  {rate:8}  {notes}"
        lines.append(line.rstrip())
    return lines


def _points(info: Info) -> str:
    """Number of points and their ranges."""
    near, middle, far = info.range_m
    return f"{info.points:,} per scan, ranges {near:.1f} to {far:.1f} m, median {middle:.1f} m"


def _scans(info: Info) -> str:
    """Number of scans, their numbers and rate."""
    numbers = f"{info.first} to {info.last}" if info.scans > 1 else f"{info.first}"
    rate = f", {info.rate_hz:.3g} Hz, {info.duration_s:.1f} s in total" if info.rate_hz else ""
    read = "" if info.looked_at == info.scans else f"; {info.looked_at} of them read"
    return f"{info.scans}, numbers {numbers}{rate}{read}"


def _stamps(info: Info) -> str:
    """Source of the stamps, and gaps."""
    if not info.holes:
        return info.stamps
    gaps = f"{info.holes} gaps, the longest of" if info.holes > 1 else "a gap of"
    return f"{info.stamps}; {gaps} {info.longest_hole_s:.3g} s"


def _truth(info: Info) -> str:
    """Extent of the ground truth."""
    if not info.truth:
        return "none"
    only = ", positions only (rotation is not compared)" if info.positions_only else ""
    return f"of {info.truth} of {info.scans} scans, {info.truth_m:.1f} m{only}"


def _lidar(info: Info) -> str:
    """The LiDAR, its vertical correction and motion compensation."""
    if info.sensor is None:
        return f"unknown; the rings match those of {info.looks_like}" if info.looks_like else "unknown"
    corrected = f", vertical correction {info.vertical_correction_deg:.3f} deg" if info.vertical_correction_deg else ""
    return f"{info.sensor}{corrected}{', scans are motion-compensated' if info.motion_compensated else ''}"


def _camera(info: Info) -> str:
    """Images and calibration of the camera."""
    if not info.images:
        return "calibrated, but no images" if info.calibrated else "none"
    size = f" of {info.image_size[0]} x {info.image_size[1]} pixels" if info.image_size else ""
    more = f"; {info.cameras - 1} more" if info.cameras > 1 else ""
    calibrated = "" if info.calibrated else "not "
    return f"images{size} for {info.images} of {info.scans} scans, {calibrated}calibrated{more}"


def _several(path: Path, names: list[str]) -> str:
    """The sequences of a folder, a line each, and the command to inspect one."""
    from slam.data.dataset import open_dataset
    from slam.data.errors import InputError

    lines = [f"{path}: {len(names)} sequences", ""]
    width = max(map(len, names))
    for name in names:
        try:
            data = open_dataset(path, name)
        except InputError as error:
            lines += _wrapped(f"{name:{width}}  {error}", "  ", " " * (width + 4))
            continue
        parts = {"camera": data.calibration, "ground truth": data.ground_truth}
        extras = [part for part, content in parts.items() if content is not None]
        seconds = data.stamps[-1] - data.stamps[0]
        lines.append(f"  {name:{width}}  {len(data):6,} scans  {seconds:8.1f} s  {', '.join(extras)}".rstrip())
    lines += ["", f"To inspect one:\n  lidarlift info {shlex.quote(str(path))} --sequence {shlex.quote(names[0])}"]
    return "\n".join(lines)


def _row(label: str, value: str) -> list[str]:
    """The lines of one property."""
    return _wrapped(value, f"  {label:{LABEL_WIDTH}}", " " * (LABEL_WIDTH + 2))


def _wrapped(text: str, first: str, others: str) -> list[str]:
    """Text wrapped to the width of the terminal; words and paths are not broken."""
    width = min(shutil.get_terminal_size().columns, MAX_WIDTH)
    return textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )
