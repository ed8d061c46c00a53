"""The page of all built-in LiDARs, from their tables of laser lines and the measured recovery of rings.

    python -m benchmarks.sensors.table

Writes docs/sensors.md. A test fails if the page differs from the tables.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import table
from benchmarks.common.script import RESULTS, parser, run_script
from enrichment.methods.lift import learned_gaps
from eval.text import number
from lidarlift.front_ends import why_not_enriched
from slam.data.atomic import write_text
from slam.data.sensor import Sensor, load_sensor
from slam.data.sensor_names import SENSORS
from slam.front_end import RingFrontEnd
from slam.settings import FrontEndSettings

PAGE = Path(__file__).parents[2] / "docs" / "sensors.md"
#: Maker and model of each name.
MODELS = {
    "hdl64": "Velodyne HDL-64E",
    "vlp16": "Velodyne VLP-16",
    "hdl32": "Velodyne HDL-32E",
    "vlp32c": "Velodyne VLP-32C",
    "vls128": "Velodyne VLS-128 (Alpha Prime)",
    "puck-hires": "Velodyne Puck Hi-Res",
    **{f"os{line}-{rings}": f"Ouster OS{line}-{rings}" for line in range(3) for rings in (16, 32, 64, 128)},
    "pandar40p": "Hesai Pandar40P",
    "pandar64": "Hesai Pandar64",
    "xt16": "Hesai PandarXT-16",
    "xt32": "Hesai PandarXT-32",
    "qt64": "Hesai QT64 (PandarQT)",
    "rs-16": "RoboSense RS-LiDAR-16",
    "rs-32": "RoboSense RS-LiDAR-32",
    "rs-helios": "RoboSense RS-Helios",
    "rs-ruby": "RoboSense RS-Ruby Plus",
    "rs-bpearl": "RoboSense RS-Bpearl",
}
INTRODUCTION = """# Built-in LiDARs

`--sensor NAME` names one of these; makers' spellings, such as `HDL-32E` or `PandarXT-32`, are understood. A
[file](data.md#the-lidar) describes any other spinning LiDAR.

This page is written by `python -m benchmarks.sensors.table`.

* **Nominal** lines are the design's or one unit's, while each unit has a calibration of its own: a note of the run says
  so. An Ouster's metadata (`--sensor FILE.json`) has the lines of its unit; `lidarlift fit-lasers` estimates the lines
  of any LiDAR from raw scans.
* **Offsets**: azimuth offsets of the lasers, and their heights above the origin, where the source has them. Enrichment
  needs the elevations; it takes azimuths from the points.
* **Enriched** are these rings with `--input enriched`; the rest of a dense LiDAR is dropped first. A dash means too
  dense: `--set front_end.enriched_rings=16` selects some. **Lift** is used in so many of the gaps between these rings,
  ray segments in the others, which are wider or narrower than those of Lift's training.
* **Rings right** is the share of points [%] of simulated scans whose ring is recovered: from laser numbers in firing
  order, and from the laser lines alone ([all ways](../benchmarks/results/rings.md)); with a ring field it is 100.

Without a name, rings are counted in the first scans, if the files have ring numbers. Livox LiDARs and others without
rings are run as recorded, and `compare` says why they are not enriched.
"""


def main() -> None:
    """Write the page."""
    parser(__doc__).parse_args()
    write_text(PAGE, page())
    print(f"wrote {PAGE}")


def page() -> str:
    """Return the page's Markdown text."""
    measured = json.loads((RESULTS / "rings.json").read_text(encoding="utf-8"))["sensors"]
    header = (
        *("name", "LiDAR", "source of the laser lines", "nominal", "offsets", "rings", "from, to [deg]"),
        *("spacing [deg]", "enriched", "Lift", "rings right"),
    )
    rows = [_row(name, load_sensor(name), measured[name]) for name in SENSORS.names()]
    return f"{INTRODUCTION}\n{table(header, rows, words=5)}"


def _row(name: str, sensor: Sensor, measured: Mapping[str, Any]) -> list[str]:
    degrees = np.rad2deg(sensor.elevation)
    steps = -np.diff(degrees)
    spacing = f"{steps.min():.2f}" if np.ptp(steps) < 0.01 else f"{steps.min():.2f} to {steps.max():.2f}"
    enriched, lift = _enrichment(sensor)
    return [
        f"`{name}`",
        MODELS[name],
        sensor.source.replace("_", r"\_"),
        "yes" if sensor.nominal else "no",
        _offsets(sensor),
        str(sensor.ring_count),
        f"{degrees[0]:.1f}, {degrees[-1]:.1f}",
        spacing,
        enriched,
        lift,
        ", ".join(number(measured[way]["right"], 1, 100) for way in ("lasers", "lines")),
    ]


def _offsets(sensor: Sensor) -> str:
    """Which offsets the table has, and how large they are."""
    azimuth, height = np.rad2deg(np.abs(sensor.azimuth).max()), 1000 * np.abs(sensor.offset).max()
    found = [f"azimuth, {azimuth:.1f} deg at most"] if azimuth else []
    found += [f"height, {height:.0f} mm at most"] if height else []
    return "; ".join(found) or "none"


def _enrichment(sensor: Sensor) -> tuple[str, str]:
    """Number of rings that are enriched, and the gaps between them in which Lift is used."""
    if why_not_enriched(sensor, sensor.ring_count):
        return "-", "-"
    _, rings = RingFrontEnd(FrontEndSettings(input="enriched"), sensor).lines()
    learned = learned_gaps(sensor, rings)
    return f"{len(rings)} of {sensor.ring_count}", f"{learned.sum()} of {len(learned)}"


if __name__ == "__main__":
    run_script(main)
