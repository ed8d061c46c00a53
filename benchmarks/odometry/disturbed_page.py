"""The page disturbed.md, made of the figures in the JSON file and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from benchmarks.common.page import table, verdict
from eval.text import number

CLOCK, RATIO, STOPS = 0.02, 1.5, 0.05  # m from the undisturbed run; of ATEs; m of ATE and along the way
Row = Mapping[str, Any]

PROTOCOL = """\
Our odometry as lidarlift sets it up for the input, no loops. `full` as recorded, `16` sixteen rings evenly, a method's
name where it fills these in. Error: rmse of positions after SE(3) alignment, to the exact truth of simulated drives, to
a slow dense trajectory of recorded ones (small_gicp's GICP, see [Scenes](scenes.md)). Degenerate, lost: frames of which
the odometry says so.
"""
TEXTS = {
    "clock": """\
From the frame in the middle on all stamps are later by so many seconds, or earlier. Apart: the distance, after SE(3)
alignment, to the run of the same drive without that.""",
    "thinned": """\
Every second or third frame, beside KISS-ICP, which gets the same clouds and deskews by the share of its own motion that
a sweep is.""",
    "sizes": """\
All of the odometry's cells and voxels (cell_sizes, voxel_size, map_voxel_size) times a factor: by how much the error
grows.""",
    "stops": """\
Frames that stand left out: those that have not come 1 cm from the last one that is kept, so that stamps have gaps.
Never standing: the same with the gaps closed. Standing longer: three frames come 30 times each. Along: how far ahead of
the truth the last position lies.""",
    "repeated": "The same run once more, in a process of its own: are all poses equal, bit for bit?",
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
        ("from the undisturbed run where the clock jumps [m]", "clock", lambda row: row["apart_m"], "<=", CLOCK),
        ("error by KISS-ICP's, every 2nd and 3rd frame", "thinned", _times, "<=", 1.0),
        ("error by that of the sizes as they are", "sizes", _growth, "<=", RATIO),
        ("ATE, stops [m]", "stops", lambda row: row["ate_m"], "<=", STOPS),
        ("end along the way, stops [m]", "stops", _off, "<=", STOPS),
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
    "clock": "Clocks that jump", "thinned": "Frames left out", "sizes": "Other sizes", "stops": "Stops",
    "repeated": "Once more",
}  # fmt: skip
#: By part its header, how many columns are words, and its rows.
TABLES: dict[str, tuple[tuple[str, ...], int, Callable[[list[Row]], Iterator[tuple[str, ...]]]]] = {
    "clock": (("drive", "input", "seconds", "apart m", "degenerate", "lost", "verdict"), 2, _clock),
    "thinned": (
        ("drive", "input", "every", "ours m", "KISS-ICP m", "times", "degenerate", "lost", "verdict"), 2, _thinned,
    ),
    "sizes": (("drive", "input", "x 0.75 m", "x 1 m", "x 1.5 m", "times", "verdict"), 2, _sizes),
    "stops": (("drive", "input", "stops", "frames", "ATE m", "along m", "degenerate", "lost", "verdict"), 3, _stops),
    "repeated": (("drive", "input", "poses", "verdict"), 3, _repeated),
}  # fmt: skip
