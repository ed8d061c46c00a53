"""How many visits of a place to map: `keyframes.max_visits`, on a round that is driven again and again.

    python -m benchmarks.loops.visits DRIVE --frames 4000

DRIVE as in long_run.py. The same frames are run with one, two, three (the default) and all visits of a place in the
map and the pose graph. Writes visits.md and .json in benchmarks/results.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.common.page import surroundings, table, target, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.rounds import CHANNELS, Rounds
from eval import trajectory
from eval.text import number
from slam.data.cloud import Array, PointCloud

VISITS = (1, 2, 3, None)  # None: all
KEPT = "3"  # the default
AWAY = 0.4  # m, two voxels: a point without one so near in the map of all visits


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("drive", type=Path, help="the simulated data set")
    arguments.add_argument("--frames", type=int, default=4000, metavar="N", help="default: 4000")
    add_results(arguments)
    options = arguments.parse_args()
    write_results(options.results, "visits", measure(options.drive, options.frames), page)


def measure(drive: Path, frames: int) -> dict[str, Any]:
    rounds = Rounds.of(drive)
    rows: dict[str, dict[str, float]] = {}
    maps: dict[str, PointCloud] = {}
    for visits in VISITS:
        name = "all" if visits is None else str(visits)
        rows[name], maps[name] = driven(rounds, frames, visits)
        print(name, rows[name], file=sys.stderr, flush=True)
    whole = cKDTree(maps["all"].xyz)
    for name, found in maps.items():
        rows[name]["missing_percent"] = away(whole.data, cKDTree(found.xyz))
        rows[name]["more_percent"] = away(found.xyz, whole)
    return {
        "about": surroundings(("numpy", "numba", "gtsam")),
        "frames": frames,
        "rounds": frames / len(rounds.scans),
        "round_m": rounds.metres,
        "visits": rows,
    }


def driven(rounds: Rounds, frames: int, visits: int | None) -> tuple[dict[str, float], PointCloud]:
    """Figures of a run in which a place is known after so many visits, and its map."""
    begin = time.process_time()
    with rounds.slam(rounds.settings(f"keyframes.max_visits={'null' if visits is None else visits}")) as slam:
        for frame in range(frames):
            slam.add(rounds.frame(frame))
        run = slam.finish()
    assert run.mapping is not None
    truth = rounds.poses(frames)
    return {
        "ate_m": trajectory.ate(run.poses, truth).rmse,
        "ate_origin_m": trajectory.ate(run.poses, truth, "origin").rmse,
        "odometry_ate_m": trajectory.ate(run.odometry_poses, truth).rmse,
        "keyframes": len(run.mapping.keyframes),
        "known": len(run.mapping.known),
        "loops": run.mapping.loops,
        "rejected": len(run.mapping.ledger) - run.mapping.loops,
        "map_points": len(run.map),
        "seconds": time.process_time() - begin,
    }, run.map


def away(points: Array, other: cKDTree) -> float:
    """Share [%] of points (N, 3) without one of the others within `AWAY`."""
    return 100 * float(np.isinf(other.query(points, distance_upper_bound=AWAY)[0]).mean())


def page(found: Mapping[str, Any]) -> str:
    about, rows = found["about"], found["visits"]
    shown = table(
        ("visits", "ATE m", "of the origin m", "loops", "rejected", "mapped keyframes", "map points", "missing %",
         "more %", "processor s"),
        [
            (
                name, number(row["ate_m"], 3), number(row["ate_origin_m"], 3), str(row["loops"]), str(row["rejected"]),
                str(row["keyframes"] - row["known"]), f"{row['map_points']:,}", number(row["missing_percent"], 2),
                number(row["more_percent"], 2), number(row["seconds"], 0),
            )
            for name, row in rows.items()
        ],
    )  # fmt: skip
    ratio = rows[KEPT]["ate_m"] / rows["all"]["ate_m"]
    targets = [target(f"ATE with {KEPT} visits to that with all", ratio, "<=", 1.1, 2)]
    return f"""
# Visits of a place

`{about["command"]}` on {about["date"]}: {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]}.

{found["frames"]:,} frames at {CHANNELS} channels, {found["rounds"]:.1f} rounds of {found["round_m"]:.0f} m through a
simulated town, by the default settings but `keyframes.max_visits`: so many visits of a place are in the map and in the
pose graph, and keyframes of later ones only get poses ([known places](../../docs/method.md)). The default is {KEPT}.

{table(("target", "measured", "limit", "verdict"), targets)}
{shown}
ATE of the poses of all frames against exact ground truth, after the best alignment and from the origin; that of the
odometry is {number(rows[KEPT]["odometry_ate_m"], 3)} m. Missing: points of the map of all visits without a point within
{AWAY:g} m; more: points without one within {AWAY:g} m in the map of all visits. Seconds are processor time of the
whole run with its map.
"""


if __name__ == "__main__":
    run_script(main)
