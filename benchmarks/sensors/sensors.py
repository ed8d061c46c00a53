"""Sparse LiDARs, plain and enriched by ray-segment: distances, depth errors, and run times.

    python -m benchmarks.sensors.sensors --data DATA

DATA holds the recordings kitti_odometry_04, kitti_raw_0013 and kitti_raw_0005, each a folder. Runs on one core, one
thread.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

if __name__ == "__main__":
    os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.odometry.tracks import Runner, Track, apart, rmse
from benchmarks.sensors.cases import CASES, FRAMES, Case, chosen
from benchmarks.sensors.sensors_page import ALL, HALF, page
from enrichment.geometry.rays import RayGrid, columns_for
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from lidarlift.front_ends import front_end_for
from slam.config import load_config
from slam.data.cloud import Array, Frame
from slam.data.dataset import Dataset
from slam.data.ring_patterns import evenly
from slam.data.sensor import Sensor

EVERY = 10  # frames between those whose depth is measured
METHOD = "ray-segment"
COVERAGE = {ALL: 1.0, HALF: 0.5}  # of the enriched inputs by their names in the JSON


def main() -> None:
    """Measure and write the page."""
    arguments = parser(__doc__)
    arguments.add_argument("--data", type=Path, required=True, metavar="DATA", help="folder of the recordings")
    arguments.add_argument("--cases", nargs="+", choices=[case.name for case in CASES], metavar="CASE",
                           help="some of %(choices)s; by default all")  # fmt: skip
    add_results(arguments)
    options = arguments.parse_args()
    pin_to_one_core()
    about = surroundings(("lidarlift", "numpy", "numba")) | {"every": EVERY, "frames": FRAMES}
    rows: list[dict[str, Any]] = []
    for case in chosen(options.cases):
        begin, data = perf_counter(), case.open(options.data)
        warm_up(case, data)
        rows += [row for start in case.starts for row in measured(case, data, start)]
        print(f"{case.name}: {perf_counter() - begin:.0f} s", file=sys.stderr)
        write_results(options.results, "sensors", {"about": about, "rows": rows}, page)


def warm_up(case: Case, data: Dataset) -> None:
    """Compile all kernels."""
    runner = Runner(data, [data[position] for position in range(4)], None)
    for kept in case.kept:
        for name in ("plain", *COVERAGE):
            run(runner, data, name, kept)


def measured(case: Case, data: Dataset, start: int) -> list[dict[str, Any]]:
    """Compare the inputs of a case, from frame `start`: a row per number of rings."""
    assert data.sensor is not None
    frames = [data[position] for position in range(len(data))[start : start + FRAMES]]
    truth = None if data.ground_truth is None else data.ground_truth[start : start + FRAMES]
    exact = truth if case.drive or case.name == "kitti_odometry_04" else None
    runner, rings = Runner(data, frames, None), data.sensor.ring_count
    full = run(runner, data, "full", rings)
    found = []
    for kept in case.kept:
        plain = full if kept == rings else run(runner, data, "plain", kept)
        sparse = {"plain": plain} | {name: run(runner, data, name, kept) for name in COVERAGE}
        tracks = {"full": full} | sparse
        found.append(
            {
                "name": case.name,
                "sensor": data.sensor.name,
                "rings": rings,
                "kept": kept,
                "start": start,
                "frames": len(frames),
                "path_length_m": full.length,
                "ate_m": None if exact is None else {name: rmse(track.poses, exact) for name, track in tracks.items()},
                "to_full_m": None if kept == rings else {name: apart(track, full) for name, track in sparse.items()},
                "failed": {name: track.failed for name, track in tracks.items()},
                "odometry_ms": {name: track.milliseconds for name, track in tracks.items()},
                "enrichment_ms": sparse[ALL].front_end_ms - plain.front_end_ms,
                "depth": depth(frames[::EVERY], data.sensor, kept),
            }
        )
    return found


def run(runner: Runner, data: Dataset, name: str, kept: int) -> Track:
    """Run the odometry on an input: full, plain or one of COVERAGE."""
    if name in COVERAGE:
        chosen: dict[str, Any] = {"enricher": METHOD, "enriched_rings": kept, "coverage": COVERAGE[name]}
        settings = load_config(input="enriched", **chosen)
    else:
        settings = load_config(input="full" if name == "full" else str(kept))
    return runner(front_end_for(settings.front_end, data.sensor, data.path), settings.odometry)


def depth(frames: Sequence[Frame], sensor: Sensor, kept: int) -> dict[str, Any]:
    """Errors of predicted ranges at the returns of rings that are withheld.

    Withheld are the dropped rings; where none is dropped, every second ring, so that gaps are twice as wide as in use.

    Returns:
        `mae_mm`, the mean absolute error of the predictions that are added to the cloud, `median_mm`, and `share`, the
        share of the withheld returns between two rings that get a point.
    """
    count = sensor.ring_count
    used = evenly(count, kept if kept < count else count // 2)
    errors, asked = [], 0
    for frame in frames:
        error, wanted = _errors(frame, sensor, used)
        errors.append(error)
        asked += wanted
    found = 1000 * np.concatenate(errors)
    return {
        "kept": len(used),
        "mae_mm": float(found.mean()) if len(found) else None,
        "median_mm": float(np.median(found)) if len(found) else None,
        "share": len(found) / asked if asked else None,
    }


def _errors(frame: Frame, sensor: Sensor, used: Array) -> tuple[Array, int]:
    """Absolute errors [m] of the added points at withheld returns, and the number of returns between two rings."""
    cloud = frame.cloud
    if cloud.ring is None or len(cloud) == 0:
        return np.zeros(0), 0
    columns = columns_for(cloud)
    grid, kept = RayGrid(sensor, columns), np.isin(cloud.ring, used)
    scan = SparseScan(cloud.select(kept), sensor, used, columns=columns)
    prediction, out = RaySegment()(scan, grid), cloud.select(~kept)
    assert out.ring is not None
    between = (scan.rows_above(sensor) >= 0)[out.ring]
    ray = out.ring, grid.column_of(out.xyz)
    added = prediction.trusted[ray]
    error = np.abs(prediction.ranges[ray] - grid.range_of(out.xyz, out.ring))[added]
    return error, int(between.sum())


if __name__ == "__main__":
    run_script(main)
