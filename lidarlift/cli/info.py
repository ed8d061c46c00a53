"""`lidarlift info`: what is in a data set, and the command to run it."""

from __future__ import annotations

import json
import shlex
import shutil
import textwrap
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import ColumnsOption, DatasetArgument, SensorOption, SequenceOption

if TYPE_CHECKING:
    from lidarlift.inspecting import Info

LABEL = 14  # characters
WIDEST = 120


def info(
    dataset: DatasetArgument,
    sequence: SequenceOption = None,
    sensor: SensorOption = None,
    columns: ColumnsOption = None,
    every_scan: Annotated[bool, typer.Option("--all", help="Read all of its scans, not a dozen.")] = False,
    json_: Annotated[bool, typer.Option("--json", help="The same as JSON.")] = False,
) -> None:
    """Say what is in a data set: scans, rate, rings, fields, times, camera, truth, gaps, and how to run it.

    Example: `lidarlift info my_drive`

    A folder of several drives is listed; `--sequence` looks into one of them.
    """
    from lidarlift.inspecting import info as look
    from slam.data.dataset import drives_in

    names = drives_in(dataset)
    if sequence is None and len(names) > 1 and not json_:
        print(_several(dataset, names))
        return
    found = look(dataset, sequence=sequence, sensor=sensor, columns=columns, every_scan=every_scan)
    print(json.dumps(asdict(found), indent=2, default=str) if json_ else page(found))


def page(info: Info) -> str:
    """A data set on one page, as wide as the terminal."""
    rows = {
        "scans": _scans(info),
        "stamps": _stamps(info),
        "points": _points(info),
        "fields": ", ".join(info.fields),
        "rings": f"{info.rings}, {info.rings_from}" if info.rings else info.rings_from,
        "point times": info.point_times,
        "LiDAR": _lidar(info),
        "camera": _camera(info),
        "ground truth": f"of {info.truth} of {info.scans} scans, {info.truth_m:.1f} m" if info.truth else "none",
    }
    lines = [f"{info.name}  ({info.path})", ""]
    lines += [line for label, value in rows.items() if value for line in _row(label, value)]
    if info.problems:
        lines += ["", "What is wrong, or assumed:"]
        for kind, count, message in info.problems:
            text = message.removeprefix(f"{info.path}: ").replace(f"{info.path}/", "")
            lines += _wrapped(f"{kind}{f' ({count} times)' if count > 1 else ''}: {text}", "  - ", "    ")
    lines += ["", "To run it:", *(f"  {command}" for command in info.commands)]
    return "\n".join(lines)


def _points(info: Info) -> str:
    near, middle, far = info.range_m
    return f"{info.points:,} a scan, {near:.1f} to {far:.1f} m away, half of them within {middle:.1f} m"


def _scans(info: Info) -> str:
    numbers = f"{info.first} to {info.last}" if info.scans > 1 else f"{info.first}"
    rate = f", {info.rate_hz:.3g} a second, {info.duration_s:.1f} s in all" if info.rate_hz else ""
    looked = "" if info.looked_at == info.scans else f"; {info.looked_at} of them looked at"
    return f"{info.scans}, numbers {numbers}{rate}{looked}"


def _stamps(info: Info) -> str:
    if not info.holes:
        return info.stamps
    gaps = f"{info.holes} gaps, the longest" if info.holes > 1 else "a gap of"
    return f"{info.stamps}; {gaps} {info.longest_hole_s:.3g} s"


def _lidar(info: Info) -> str:
    if info.sensor is None:
        return f"not named; its rings lie like those of {info.looks_like}" if info.looks_like else "not named"
    corrected = f", elevations raised by {info.vertical_correction_deg:.3f} deg" if info.vertical_correction_deg else ""
    return f"{info.sensor}{corrected}{', scans are motion-compensated' if info.motion_compensated else ''}"


def _camera(info: Info) -> str:
    if not info.images:
        return "calibrated, but no images" if info.calibrated else "none"
    size = f" of {info.image_size[0]} x {info.image_size[1]} pixels" if info.image_size else ""
    return f"images{size} for {info.images} of {info.scans} scans, {'' if info.calibrated else 'not '}calibrated"


def _several(path: Path, names: list[str]) -> str:
    """The drives of a folder, a line each, and how to look into one."""
    from slam.data.dataset import open_dataset
    from slam.data.errors import InputError

    lines = [f"{path}: {len(names)} drives", ""]
    width = max(map(len, names))
    for name in names:
        try:
            data = open_dataset(path, name)
        except InputError as error:
            lines += _wrapped(f"{name:{width}}  {error}", "  ", " " * (width + 4))
            continue
        beside = [
            word for word, there in (("camera", data.calibration), ("truth", data.ground_truth)) if there is not None
        ]
        seconds = data.stamps[-1] - data.stamps[0]
        lines.append(f"  {name:{width}}  {len(data):6,} scans  {seconds:8.1f} s  {', '.join(beside)}".rstrip())
    lines += ["", f"To look into one:\n  lidarlift info {shlex.quote(str(path))} --sequence {shlex.quote(names[0])}"]
    return "\n".join(lines)


def _row(label: str, value: str) -> list[str]:
    return _wrapped(value, f"  {label:{LABEL}}", " " * (LABEL + 2))


def _wrapped(text: str, first: str, others: str) -> list[str]:
    """Text in lines no wider than the terminal; words, paths among them, stay whole."""
    width = min(shutil.get_terminal_size().columns, WIDEST)
    return textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )
