"""The page disturbed.md, made of the figures in the JSON file and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from benchmarks.common.page import table, verdict
from eval.text import number

CLOCK, RATIO, STOPS = 0.02, 1.5, 0.05  # m from the undisturbed run; of ATEs; m of ATE and along the path
Row = Mapping[str, Any]

PROTOCOL = """\
Our odometry with the default settings for the input, without loops. Inputs: `full`, as recorded; `16`, sixteen evenly
spaced rings; or these enriched by the method named. Error: rmse of positions after SE(3) alignment to the exact ground
truth of simulated sequences, or to a slow dense trajectory of recorded ones (small_gicp's GICP, see
[Scenes](scenes.md)). Degenerate, lost: frames with the status `degenerate` or `failed`.
"""
TEXTS = {
    "clock": """\
From the middle frame on, all stamps are shifted by the number of seconds given. Apart: the distance, after SE(3)
alignment, to the run of the same sequence without the shift.""",
    "thinned": """\
Every second or third frame, compared with KISS-ICP, which gets the same clouds and deskews with the part of its
predicted motion that a sweep covers.""",
    "sizes": """\
All cell and voxel sizes of the odometry (cell_sizes, voxel_size, map_voxel_size) are multiplied by a factor; the
figures are the errors.""",
    "stops": """\
Standing frames removed: frames within 1 cm of the last frame kept are left out, so that stamps have gaps. Never
standing: the same with the gaps closed. Standing longer: three frames are repeated 30 times each. Along: how far the
last position is ahead of the ground truth.""",
    "repeated": "The same run is repeated in another process, and all poses are compared bit for bit.",
}


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: rows by part, and "about"."""
    note = f"\n{found['about']['note']}\n" if "note" in found["about"] else ""
    about, parts = found["about"], [part for part in TABLES if found.get(part)]
    text = f"""# Odometry, disturbed

{about["date"]}, {about["cpu"]}, {about["cores"]} cores.

```
{about["command"]}
```
{note}
{PROTOCOL}
{table(("target", "worst", "limit", "cases met", "verdict"), targets(found))}"""
    for part in parts:
        header, words, rows = TABLES[part]
        text += f"\n## {TITLES[part]}\n\n{TEXTS[part]}\n\n{table(header, rows(found[part]), words)}"
    return text


def targets(found: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Targets: name, worst figure, limit, number of cases in which it is met, and whether it is met in all."""
    goals: tuple[tuple[str, str, Callable[[Row], float | None], str, float], ...] = (
        ("distance to the undisturbed run, clock jumps [m]", "clock", lambda row: row["apart_m"], "<=", CLOCK),
        ("error relative to KISS-ICP, every 2nd and 3rd frame", "thinned", _times, "<=", 1.0),
        ("error relative to that with the default sizes", "sizes", _growth, "<=", RATIO),
        ("ATE, stops [m]", "stops", lambda row: row["ate_m"], "<=", STOPS),
        ("end along the path, stops [m]", "stops", _off, "<=", STOPS),
        ("runs that repeat bit for bit", "repeated", lambda row: float(row["equal"]), ">=", 1),
    )
    for what, part, figure, relation, limit in goals:
        if not found.get(part):
            continue
        values = [value for row in found[part] if (value := figure(row)) is not None]
        worst = (max if relation == "<=" else min)(values, default=None)
        met = sum(verdict(value, relation, limit) == "met" for value in values)
        yield (
            what, number(worst, 3), f"{relation} {limit:g}", f"{met} of {len(values)}", verdict(worst, relation, limit),
        )  # fmt: skip


def _times(row: Row) -> float | None:
    """Our error by KISS-ICP's; None where one of them is not known."""
    return row["ours_m"] / row["kiss_m"] if row["ours_m"] is not None and row["kiss_m"] else None


def _growth(row: Row) -> float | None:
    """The largest error with other sizes by that with the settings' own."""
    scaled = [error for error in row["scaled_m"].values() if error is not None]
    return max(scaled) / row["base_m"] if scaled and row["base_m"] else None


def _off(row: Row) -> float | None:
    return None if row["along_track_m"] is None else abs(row["along_track_m"])


def _clock(rows: list[Row]) -> Iterator[tuple[str, ...]]:
    for row in rows:
        yield (
            row["drive"], row["input"], f"{row['seconds']:+g}", number(row["apart_m"], 4), *_told(row),
            verdict(row["apart_m"], "<=", CLOCK),
        )  # fmt: skip


def _thinned(rows: list[Row]) -> Iterator[tuple[str, ...]]:
    for row in rows:
        times = _times(row)
        yield (
            row["drive"], row["input"], str(row["step"]), number(row["ours_m"], 4), number(row["kiss_m"], 4),
            number(times, 2), *_told(row), verdict(times, "<=", 1.0),
        )  # fmt: skip


def _sizes(rows: list[Row]) -> Iterator[tuple[str, ...]]:
    for row in rows:
        growth, scaled = _growth(row), row["scaled_m"]
        yield (
            row["drive"], row["input"], number(scaled["0.75"], 4), number(row["base_m"], 4), number(scaled["1.5"], 4),
            number(growth, 2), verdict(growth, "<=", RATIO),
        )  # fmt: skip


def _stops(rows: list[Row]) -> Iterator[tuple[str, ...]]:
    for row in rows:
        worst = max(row["ate_m"], _off(row) or 0.0)
        yield (
            row["drive"], row["input"], row["what"], str(row["frames"]), number(row["ate_m"], 3),
            "-" if row["along_track_m"] is None else f"{row['along_track_m']:+.3f}", *_told(row),
            verdict(worst, "<=", STOPS),
        )  # fmt: skip


def _repeated(rows: list[Row]) -> Iterator[tuple[str, ...]]:
    for row in rows:
        yield row["drive"], row["input"], "equal" if row["equal"] else "differ", "met" if row["equal"] else "missed"


def _told(row: Row) -> tuple[str, str]:
    return number(row["degenerate"], 0), number(row["lost"], 0)


TITLES = {
    "clock": "Clock jumps", "thinned": "Frames left out", "sizes": "Other sizes", "stops": "Stops",
    "repeated": "Repeated runs",
}  # fmt: skip
#: By part its header, how many columns are words, and its rows.
TABLES: dict[str, tuple[tuple[str, ...], int, Callable[[list[Row]], Iterator[tuple[str, ...]]]]] = {
    "clock": (("sequence", "input", "seconds", "apart m", "degenerate", "lost", "verdict"), 2, _clock),
    "thinned": (
        ("sequence", "input", "every", "ours m", "KISS-ICP m", "times", "degenerate", "lost", "verdict"), 2, _thinned,
    ),
    "sizes": (("sequence", "input", "x 0.75 m", "x 1 m", "x 1.5 m", "times", "verdict"), 2, _sizes),
    "stops": (("sequence", "input", "stops", "frames", "ATE m", "along m", "degenerate", "lost", "verdict"), 3, _stops),
    "repeated": (("sequence", "input", "poses", "verdict"), 3, _repeated),
}  # fmt: skip
