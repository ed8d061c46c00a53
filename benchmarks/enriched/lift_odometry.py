"""Does Lift bring the odometry nearer to what it gives on 64 channels than ray segments, which learn nothing?

    python -m benchmarks.enriched.lift_odometry kitti_odometry_04 kitti_raw_0005 kitti_raw_0013 \\
        --held-out 0005=FOLDER --held-out 0013=FOLDER

also takes the town's loop, jam and straight (simulated with a camera, once, into the user's cache; other
towns than those trained in); writes lift_odometry.md and .json in benchmarks/results. FOLDER has the weights of a
training that left this drive out; other drives are driven with those that are shipped.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.cores import pin_to_one_core
from benchmarks.common.page import surroundings, table, target, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.common.simulated import CACHE, TOWNS, scene
from benchmarks.enriched.recipes import SIXTEEN
from benchmarks.odometry.tracks import Runner, apart, front_ends, geometric_mean, rmse
from benchmarks.weights.lift_weights import held_out, lift_for
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.methods.registry import LIFT
from eval.text import number
from slam.data.dataset import Dataset, open_dataset
from slam.settings import OdometrySettings

PLAIN, DENSE, SEGMENT = "16", "64", "ray-segment"
HEADER = ("sequence", "weights", "16 cm", "ray-segment cm", "lift cm", "times nearer: ray-segment", "lift", "failed")
INPUTS = (DENSE, PLAIN, SEGMENT, LIFT)
TRUTH_HEADER = (
    "sequence", *(f"{figure} {name}" for figure in ("ATE cm", "NEES") for name in INPUTS), "ms ray-segment", "ms lift",
)  # fmt: skip


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("datasets", nargs="+", type=Path, metavar="DATASET")
    arguments.add_argument("--held-out", action="append", type=held_out, default=[], metavar="SEQUENCE=FOLDER")
    arguments.add_argument("--towns", nargs="*", default=TOWNS)
    add_results(arguments)
    options = arguments.parse_args()
    pin_to_one_core()
    rows: list[dict[str, Any]] = []
    for path in options.datasets:
        rows.append(measured(open_dataset(path), dict(options.held_out)))
        print(rows[-1], file=sys.stderr)
    for name in options.towns:
        rows.append(measured(scene(name, camera=True), {}))
        print(rows[-1], file=sys.stderr)
    about = surroundings(("numpy", "numba", "onnxruntime"))
    write_results(options.results, "lift_odometry", {"about": about, "recipes": SIXTEEN, "rows": rows}, page)


def measured(data: Dataset, folders: Mapping[str, Path]) -> dict[str, Any]:
    """Measure the odometry by input, with distances to the 64-channel odometry [m].

    Args:
        data: The drive.
        folders: Folders of weights trained without a drive, by the end of its name.

    Raises:
        InputError: Lift has no weights.
    """
    about, lift = lift_for(data.name, folders)
    frames, truth = [data[position] for position in range(len(data))], data.ground_truth
    known = truth if truth is not None and np.isfinite(truth).all() else None
    run = Runner(data, frames, known if data.path.is_relative_to(CACHE) else None)
    tracks, to_64 = {}, {}
    for name, (front_end, settings) in front_ends(data, {SEGMENT: RaySegment(), LIFT: lift}).items():
        tracks[name] = run(front_end, settings)
        if name == PLAIN:
            plain = [run(front_end, OdometrySettings(**recipe)) for recipe in SIXTEEN.values()]
            to_64[name] = min(apart(track, tracks[DENSE]) for track in plain)
        else:
            to_64[name] = apart(tracks[name], tracks[DENSE])
    return {
        "drive": data.name,
        "weights": about,
        "to_64": to_64,
        "failed": tracks[LIFT].failed,
        "ate": {name: None if known is None else rmse(track.poses, known) for name, track in tracks.items()},
        "nees": {name: track.nees for name, track in tracks.items()},
        "front_end_ms": {name: track.front_end_ms for name, track in tracks.items()},
    }


def gains(rows: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    """How many times nearer to 64 channels than the best recipe for 16."""
    return [row["to_64"][PLAIN] / row["to_64"][name] for row in rows]


def targets(rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str, str]]:
    """Targets: name, figure, limit, and whether it is met."""
    distances = [row["to_64"] for row in rows]
    nearer = sum(each[LIFT] < each[SEGMENT] for each in distances)
    times = geometric_mean([each[SEGMENT] / each[LIFT] for each in distances])
    lost = max(each[LIFT] - each[PLAIN] for each in distances)
    nees = [row["nees"][LIFT] for row in rows if row["nees"][LIFT] is not None]
    return [
        target(
            f"sequences of {len(rows)} on which lift is nearer than ray-segment", nearer, ">=", len(rows) // 2 + 1, 0
        ),
        target("times nearer than ray-segment, geometric mean", times, ">=", 1, 2),
        target("further from 64 channels than 16, anywhere, at most [cm]", 100 * lost, "<=", 0.5, 2),
        target("NEES of lift on the town, least", min(nees, default=None), ">=", 0.5, 2),
        target("NEES of lift on the town, most", max(nees, default=None), "<=", 2, 2),
    ]


def page(found: Mapping[str, Any]) -> str:
    about, rows = found["about"], found["rows"]

    times = {name: gains(rows, name) for name in (SEGMENT, LIFT)}
    means = {name: number(geometric_mean(each), 2) for name, each in times.items()}
    lines, truths = [], []
    for row, segment, lift in zip(rows, times[SEGMENT], times[LIFT], strict=True):
        distances = (number(row["to_64"][name], 2, 100) for name in (PLAIN, SEGMENT, LIFT))
        lines.append(
            (row["drive"], row["weights"], *distances, number(segment, 2), number(lift, 2), str(row["failed"]))
        )
        ates = (number(row["ate"][name], 2, 100) for name in INPUTS)
        nees = (number(row["nees"][name], 2) for name in INPUTS)
        milliseconds = (number(row["front_end_ms"][name], 1) for name in (SEGMENT, LIFT))
        truths.append((row["drive"], *ates, *nees, *milliseconds))
    return f"""# SLAM with Lift

{about["date"]}, {about["cpu"]}, one core.
`{about["command"]}`

* Every 4th ring from ring 0, enriched by ray-segment and by lift, which also uses the camera's image; both are
  registered with the same settings. cm: rmse of positions to the trajectory of our odometry on all 64 channels, after
  SE(3) alignment. 16: the best of the fixed recipes in benchmarks/enriched/recipes.py, per sequence.
* Weights: of a training without this sequence; shipped, from trainings without this sequence; or shipped, trained on
  this sequence too, which is no test. The towns differ from those of the training.
* Times nearer than 16, geometric mean: ray-segment {means[SEGMENT]}, lift {means[LIFT]}.

{table(("target", "figure", "limit", "verdict"), targets(rows))}
{table(HEADER, lines, words=2)}
ATE against the ground truth (KITTI's errs by more than the odometry, except on 04; that of the town is exact), and NEES
of the motion between frames per degree of freedom: 1 for a consistent covariance. ms: median time of the enrichment of
a frame, one core, on a busy machine; for Lift's time see [Depth with Lift](lift_depth.md).

{table(TRUTH_HEADER, truths)}"""


if __name__ == "__main__":
    run_script(main)
