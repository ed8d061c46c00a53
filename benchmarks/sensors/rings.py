"""Rings recovered from simulated scans of every built-in LiDAR: from ring numbers, laser numbers and laser lines.

python -m benchmarks.sensors.rings
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, verdict, write_results
from benchmarks.common.script import add_results, parser, run_script
from eval.text import number
from slam.data.cloud import Array
from slam.data.point_files import Points
from slam.data.scan_columns import find_columns
from slam.data.sensor import Sensor
from slam.data.sensor_names import SENSORS
from slam.simulation.drives import built_in
from slam.simulation.heads import Lidar
from slam.simulation.lidar import Scan
from slam.simulation.rig import Rig

FRAMES = (30, 90, 150, 210)  # of the drive around the block
WANTED = 0.99  # share of the points with the right ring
UNIT = np.deg2rad(0.1)  # standard deviation of the elevations of a unit's lasers from a nominal table
#: Ways to learn the rings, by their keys in the JSON: the titles of the columns.
WAYS = {
    "field": "ring field",
    "lasers": "laser numbers",
    "unnamed": "ring field, LiDAR not named",
    "lines": "laser lines",
    "order": "order in the file",
    "unit": "laser lines, another unit",
}


def main() -> None:
    """Measure and write the page."""
    arguments = parser(__doc__)
    add_results(arguments)
    options = arguments.parse_args()
    rig = Rig(built_in("loop", None), Lidar.of("hdl64"), 0, distort=True, camera=False)
    found = {name: measured(rig, name) for name in SENSORS.names()}
    about = surroundings(("lidarlift", "numpy")) | {"frames": len(FRAMES), "unit_deg": float(np.rad2deg(UNIT))}
    write_results(options.results, "rings", {"about": about, "sensors": found}, page)


def measured(rig: Rig, name: str) -> dict[str, Any]:
    """Measure the share of points with the right ring by each of WAYS, and what is reported.

    Args:
        rig: The rig of a simulation; its LiDAR is replaced.
        name: Name of the LiDAR.
    """
    lidar = Lidar.of(name).unhidden()
    scans = list(_simulated(rig, lidar))
    points = int(np.median([len(scan.xyz) for scan in scans]))
    found: dict[str, Any] = {"rings": lidar.sensor.ring_count, "points": points}
    for way in WAYS:
        if way == "unit":
            if not lidar.sensor.nominal:
                continue
            scans = list(_simulated(rig, replace(lidar, sensor=another_unit(lidar.sensor))))
        found[way] = right(scans, lidar.sensor, way)
    return found


def _simulated(rig: Rig, lidar: Lidar) -> Iterator[Scan]:
    rig.lidar = lidar
    return (rig.frame(index).scan for index in FRAMES)


def another_unit(sensor: Sensor) -> Sensor:
    """Return a LiDAR whose lasers are off the table by UNIT, still in the same order."""
    off = np.random.default_rng(7).normal(0, UNIT, sensor.ring_count)
    return replace(sensor, elevation=np.sort(sensor.elevation + off)[::-1])


def right(scans: Sequence[Scan], sensor: Sensor, way: str) -> dict[str, Any]:
    """Recover the rings of scans.

    Returns:
        `right`, the share of points with the right ring, counted from the lowest ring if the LiDAR is not named;
        `counted`, the number of rings; and `said`, the kinds of the problems.
    """
    given = [_points(scan, sensor.ring_count, way) for scan in scans]
    columns = find_columns([(points, None) for points, _ in given], None if way == "unnamed" else sensor)
    assert columns.rings is not None
    correct = total = 0
    for points, from_bottom in given:
        cloud, _ = columns.cloud(points, 0.0, Path("scan"))
        total += len(from_bottom)
        if cloud.ring is not None and len(cloud) == len(from_bottom):
            correct += int(np.sum(columns.rings - 1 - cloud.ring == from_bottom))
    said = [problem.kind for problem in columns.problems if problem.kind != "nominal laser lines"]
    return {"right": correct / total, "counted": columns.rings, "said": said}


def _points(scan: Scan, rings: int, way: str) -> tuple[Points, Array]:
    """A scan as a file has it, and the true ring of each point, counted from the bottom."""
    order = np.arange(len(scan.ring)) if way == "order" else np.argsort(scan.fraction, kind="stable")
    xyz, from_bottom = scan.xyz[order], rings - 1 - scan.ring[order].astype(np.int64)
    numbers = {
        "field": from_bottom,  # as Velodyne's driver has it
        "unnamed": from_bottom,
        "lasers": firing_order(rings)[from_bottom],
    }
    return Points(xyz, ring=numbers.get(way)), from_bottom


def firing_order(rings: int) -> Array:
    """Return the laser numbers (R,) of rings from the bottom: lower and upper half take turns, as in a VLP-16."""
    half = -(-rings // 2)
    return np.where(np.arange(rings) < half, 2 * np.arange(rings), 2 * (np.arange(rings) - half) + 1)


def page(found: Mapping[str, Any]) -> str:
    """Return the page's Markdown text."""
    about, sensors = found["about"], found["sensors"]
    lowest = min(each[way]["right"] for each in sensors.values() for way in WAYS if way != "unit")
    rows = ([name, *(_cell(each.get(way), each["rings"]) for way in WAYS)] for name, each in sensors.items())
    return f"""
# Rings of every built-in LiDAR

{about["date"]}, {about["cpu"]}. `{about["command"]}`

* Share of the points [%] of {about["frames"]} simulated scans with the right ring. The LiDAR drives around the block;
  points have the simulator's errors of range and angle, and whole millimetres.
* Ring field: numbers from the bottom, with the LiDAR named and not named. Laser numbers: in firing order, lower and
  upper half in turn. Laser lines: no numbers, points in the order of time; the nearest line decides. Order in the file:
  no numbers, ring by ring, as in KITTI's files.
* Not named: counted from the lowest ring. The uppermost rings may have no returns; a number in brackets is the number
  of rings that is then assumed, where it is wrong.
* Another unit: a LiDAR whose lasers are off the built-in table, which is nominal, by {about["unit_deg"]:.1f} deg
  (standard deviation). "Reported": `info` and `run` state that the points do not lie on the laser lines.

The lowest share, without another unit: {number(lowest, 2, 100)} %; target: at least {100 * WANTED:.0f} %,
{verdict(lowest, ">=", WANTED)}.

{table(("LiDAR", *WAYS.values()), rows)}
Where the laser lines of a model are nominal and nearer to each other than a few tenths of a degree, a unit needs a ring
field, its metadata (Ouster's .json) or `lidarlift fit-lasers`.
"""


def _cell(entry: Mapping[str, Any] | None, rings: int) -> str:
    if entry is None:
        return "-"
    counted = "" if entry["counted"] == rings else f" ({entry['counted']})"
    return f"{number(entry['right'], 2, 100)}{counted}{', reported' if 'laser lines' in entry['said'] else ''}"


if __name__ == "__main__":
    run_script(main)
