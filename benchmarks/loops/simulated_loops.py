"""Loop closure on simulated drives with exact ground truth: ATE before and after, revisits found, false loops.

    python -m benchmarks.loops.simulated_loops TRAJECTORIES

drives the town's loop and the paths of KITTI 05, 06 and 07 (TRAJECTORIES/kitti_05_ground_truth.txt ..), LiDAR only,
simulated once into the user's cache, at 64 and at 16 channels and with these enriched; writes simulated_loops.md, .json
and .png (precision and recall) in benchmarks/results. Where the odometry is off by less than 0.5 m when it first comes
back, seeded drift is added.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, target, verdict, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.drives import SPACING, add_drives, drive
from benchmarks.loops.revisits import WRONG, as_recorded, draw_detection, drifting, loop_figures, revisits
from eval.evaluation import evaluate_poses
from eval.text import number
from eval.trajectory import distances
from lidarlift.front_ends import front_end_maker
from slam.compilation import compile_kernels
from slam.config import load_config
from slam.data import se3
from slam.data.dataset import Dataset
from slam.pipeline import Pipeline

NEAR, AGO = 4.0, 100.0  # m, and m of path: what is a revisit
#: Inputs, and the settings that differ.
INPUTS: dict[str, tuple[str, ...]] = {
    "64": (),
    "16": (),
    "enriched": ("front_end.enricher=ray-segment",),  # quick, and these drives have no camera
}
SWEEP_MS = 100  # a frame of the LiDAR
SMALL = 0.5  # m: less than that at the first revisit, and drift is added
HEADER = (
    "sequence", "channels", "frames", "own ATE m", "drift", "ATE before m", "after m", "times less",
    "in height m", "with true loops m", "revisits", "found", "recall", "loops", "wrong", "worst m",
    "seconds", "waiting ms",
)  # fmt: skip


def main() -> None:
    arguments = parser(__doc__)
    add_drives(arguments)
    add_results(arguments)
    options = arguments.parse_args()
    rows: list[dict[str, Any]] = []
    for name in options.drives:
        data = drive(name, options.trajectories)
        for channels in INPUTS:
            rows.append(measured(name, data, channels))
            print({key: value for key, value in rows[-1].items() if key != "detection"}, file=sys.stderr)
    about = surroundings(("numpy", "numba", "gtsam"))
    write_results(options.results, "simulated_loops", {"about": about, "drives": rows}, page)
    runs = {name: {str(row["channels"]): row for row in rows if row["drive"] == name} for name in options.drives}
    draw_detection(runs, options.results / "simulated_loops.png")


def measured(name: str, data: Dataset, channels: str) -> dict[str, Any]:
    config = load_config(input=channels, overrides=INPUTS[channels])
    compile_kernels(config, lambda: None)
    truth = data.ground_truth
    assert truth is not None
    begin = time.perf_counter()
    pipeline = Pipeline(config, front_end_maker(config.front_end, data.sensor, data.path))
    run = pipeline.run(data)
    seconds = time.perf_counter() - begin
    waiting = float(np.mean([record.milliseconds["waiting"] for record in run.records]))
    own = evaluate_poses(run.odometry_poses, truth).ate.aligned.rmse
    first = revisits(truth, distances(truth), NEAR, AGO)[0]
    off = np.linalg.norm((se3.inverse(truth[first]) @ run.odometry_poses[first])[:3, 3])
    drifted = bool(off < SMALL)
    if drifted:
        run = pipeline.run(data, recorded=as_recorded(data.stamps, drifting(run.odometry_poses)))
    assert run.mapping is not None
    places = truth[run.mapping.keyframes.indices]
    return {
        "drive": name,
        "channels": channels,
        "frames": len(data),
        "drift added": drifted,
        "seconds": seconds,
        "waiting_ms": waiting,
        "own_ate": own,
    } | loop_figures(run, truth, revisits(places, distances(places), NEAR, AGO), NEAR)


def page(found: Mapping[str, Any]) -> str:
    about, rows = found["about"], found["drives"]
    lines = [
        (
            str(row["drive"]), str(row["channels"]), str(row["frames"]), number(row["own_ate"], 3),
            "added" if row["drift added"] else "its own",
            number(row["ate_before"], 3), number(row["ate_after"], 3),
            number(row["ate_before"] / row["ate_after"], 1),
            number(row["height_after"], 3), number(row["ate_true_loops"], 3),
            str(row["revisits"]), str(row["found"]), number(row["found"] / max(row["revisits"], 1), 2),
            str(row["loops"]), str(row["wrong"]), number(row["worst"], 2), number(row["seconds"], 0),
            number(row["waiting_ms"], 1),
        )
        for row in rows
    ]  # fmt: skip
    return f"""# Loops

{about["date"]}, {about["cpu"]}, {about["cores"]} cores.
`{about["command"]}`

* The loop of the town, and towns along the paths of KITTI 05, 06 and 07, {SPACING} m between frames, LiDAR only, with
  exact ground truth.
* ATE: rmse after SE(3) alignment, over all frames, before and after loops. Drift: if the error of the odometry is below
  {SMALL} m at the first revisit, 1 % of the travelled distance and 1 deg per 100 m are added; own ATE is without them.
* Revisits: keyframes within {NEAR:g} m of one more than {AGO:g} m of travelled distance before, in any direction.
  Found: revisits with an accepted loop. Wrong: loops with an error above {WRONG:g} m; worst: the largest error of a
  loop.
* Precision and recall of the descriptors alone (first candidate of each keyframe, over the distance threshold; a
  candidate within {NEAR:g} m is right) and after verification: [the picture](simulated_loops.png).
* In height: the vertical part of the ATE after loops. With true loops: the ATE after loops if the same loops had
  exactly the true relative poses; no verification can do better.
* Seconds: the whole run with our odometry, including the map, on a machine shared with other programs. Waiting: mean
  time per frame for which the odometry waits for keyframes, loops and graph; it waits when these are 20 scans behind,
  since scans are read from disk faster than in the 100 ms of a LiDAR.

{table(("target", "figure", "limit", "verdict"), targets(rows))}
{table(HEADER, lines, words=2)}
The errors that remain after loops are mostly in height: loops do not constrain how a path bends up and down between
them, and the same is true with exact loops.
"""


def targets(rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str, str]]:
    """Targets: name, worst figure of all drives, limit, and whether it is met."""
    lines = []
    for channels in INPUTS:
        some = [row for row in rows if row["channels"] == channels]
        least = min(row["ate_before"] / row["ate_after"] for row in some)
        recall = min(row["found"] / max(row["revisits"], 1) for row in some)
        enough = 0.9 if channels == "64" else 0.8
        lines += [
            target(f"{channels}: ATE, times less after loops", least, ">=", 3, 1),
            target(f"{channels}: recall of revisits", recall, ">=", enough, 2),
        ]
    wrong, waiting = sum(row["wrong"] for row in rows), max(row["waiting_ms"] for row in rows)
    lines.append(("wrong loops in the graph", str(wrong), "0", verdict(wrong, "<=", 0)))
    return [*lines, target("waiting [ms a frame]", waiting, "<=", SWEEP_MS, 1)]


if __name__ == "__main__":
    run_script(main)
