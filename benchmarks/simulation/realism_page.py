"""The page realism.md and its curves, made of the figures in the JSON file and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.page import table, without_about
from benchmarks.simulation.scan_figures import RANGES, RINGS
from eval.text import number
from slam.data.plot_style import save_png, tidy

Results = dict[str, Any]  # [drive]["scans" | "odometry"] -> figures

NOTES = """\
* Scans: evenly spaced over the sequence, deskewed by the true motion if they are not motion-compensated, with the
  vertical correction of the sensor; means over scans, except for the returns of a ring (medians).
* Planes: cells of 1 m with 20 points or more that are much thinner than wide; the RMS distance of the points from the
  cell's plane includes noise and unevenness. Ground: within 25 cm of the plane that fits 3-30 m around the car.
* Jumps: neighbours along a ring whose ranges differ by 1 m or more. Hanging: points at such an edge, between their
  neighbours and 30 cm or more from both: mixed pixels, and oblique or ragged surfaces.
* Odometry: ATE after SE(3) alignment and KITTI's drift, relative to the ground truth of each sequence, which is exact
  for simulated sequences only. The relation between the two systems is to be compared, not the figures themselves.
"""


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: the drives by name, and "about"."""
    about, results = found["about"], without_about(found)
    versions = ", ".join(f"{name} {text}" for name, text in about["versions"].items())
    parts = [
        "# Realism\n",
        f"{about['date']}, {about['cpu']}; {versions}.\n",
        f"```\n{about['command']}\n```\n",
        "![Points by range, returns by ring and jumps by ring, one line per sequence](realism.png)\n",
        NOTES,
        table(("", *results), _looks([entry["scans"] for entry in results.values()])),
        table(
            ("sequence", "channels", "system", "ATE m", "drift %", "path m", "lost"),
            [
                (drive, channels, system, *_behaviour(entry))
                for drive, figures in results.items()
                for channels, systems in figures["odometry"].items()
                for system, entry in systems.items()
            ],
            words=3,
        ),
    ]
    return "\n".join(parts)


def _looks(drives: list[Results]) -> list[tuple[str, ...]]:
    """Rows of the table of scans: a name, then the figure of each drive."""

    def row(name: str, text: Callable[[Results], str]) -> tuple[str, ...]:
        return name, *(text(drive) for drive in drives)

    def percent(key: str) -> Callable[[Results], str]:
        return lambda drive: number(100 * drive[key], 1)

    def share(span: int) -> Callable[[Results], str]:
        return lambda drive: number(100 * drive["range_shares"][span], 1)

    def spacing(span: int) -> Callable[[Results], str]:
        return lambda drive: _millimetres([drive["spacing_m"][span]])

    def mean(key: str, first: int) -> Callable[[Results], str]:
        return lambda drive: _mean_of_rings(drive[key][first : first + RINGS])

    groups = range(0, max(len(drive["ring_points"]) for drive in drives), RINGS)
    spans = [f"{near:g}-{far:g} m" if np.isfinite(far) else f"> {near:g} m" for near, far in pairwise(RANGES)]
    return [
        row("scans", lambda drive: str(drive["scans"])),
        row("points per scan", lambda drive: f"{drive['points']:.0f}"),
        row("5 % and 95 %", lambda drive: "{:.0f}-{:.0f}".format(*drive["points_5_95"])),
        *(row(f"at {span} [%]", share(i)) for i, span in enumerate(spans)),
        *(row(f"returns of rings {first}-{first + RINGS - 1}", mean("ring_points", first)) for first in groups),
        *(row(f"jumps of rings {first}-{first + RINGS - 1}", mean("ring_jumps", first)) for first in groups),
        row("at a jump [%]", percent("jump_share")),
        row("hanging [%]", percent("hanging_share")),
        row("on the ground [%]", percent("ground_share")),
        row("flat cells, median and 90 % [mm]", lambda drive: _millimetres(drive["flat_m"])),
        row("upright cells, median and 90 % [mm]", lambda drive: _millimetres(drive["upright_m"])),
        *(row(f"to the nearest point at {span} [mm]", spacing(i)) for i, span in enumerate(spans)),
        row("reflectance 5, 25, 50, 75, 95 %", lambda drive: " ".join(f"{q:.2f}" for q in drive["reflectance"])),
        row("of reflectance 0 [%]", percent("dark_share")),
    ]


def _mean_of_rings(rings: list[float]) -> str:
    return f"{np.mean(rings):.0f}" if rings else "-"


def _millimetres(metres: list[float]) -> str:
    return ", ".join("-" if not np.isfinite(value) else f"{1000 * value:.1f}" for value in metres)


def _behaviour(entry: Results) -> tuple[str, ...]:
    if entry["error"]:
        return "failed", "-", "-", "-"
    drift = (entry["drift"] or {}).get("translation_percent")
    return (
        number(entry["ate_m"], 3),
        number(drift, 3),
        number(entry["path_length_m"], 1),
        number(entry["failed_frames"], 0),
    )


def draw(results: Results, path: Path) -> None:
    """Write the PNG: shares by range, returns and jumps by ring, a line a drive."""
    figure = Figure(figsize=(12.6, 4.0), layout="constrained")
    by_range, returns, jumps = figure.subplots(1, 3)
    for drive, figures in results.items():
        scans = figures["scans"]
        by_range.stairs(100 * np.array(scans["range_shares"]), range(len(RANGES)), baseline=None, label=drive)
        returns.plot(scans["ring_points"], label=drive)
        jumps.plot(scans["ring_jumps"], label=drive)
    by_range.set_xticks(range(len(RANGES)), [f"{edge:g}" for edge in RANGES])
    by_range.set(xlabel="range [m]", ylabel="points [%]")
    returns.set(xlabel="ring, 0 = top", ylabel="returns a turn")
    jumps.set(xlabel="ring, 0 = top", ylabel="jumps of 1 m and more")
    for axes in (by_range, returns, jumps):
        tidy(axes)
    by_range.legend(frameon=False)
    save_png(figure, path, dpi=130)
