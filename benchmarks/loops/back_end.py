"""The back end compared with plain solvers on pose graphs with false loops: loops kept, accuracy, seconds.

    python -m benchmarks.loops.back_end DATA

writes back_end.md and .json in benchmarks/results. DATA holds `posegraphs` (g2o) and `trajectories` (KITTI 00:
KISS-ICP's estimate and the ground truth). Linux only (pins to a core).
"""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks.common.cores import pin_to_one_core
from benchmarks.common.page import surroundings, table, target, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.gtsam_solvers import HUBER, with_huber
from benchmarks.loops.pose_graphs import Case, grown, kitti_00, posegraph
from eval.text import number
from slam.data.cloud import Array
from slam.graph.back_end import BackEnd
from slam.graph.clusters import QUANTILES
from slam.graph.ledger import LoopCandidate
from slam.graph.loop_selection import select_loops
from slam.graph.solver import gnc, optimised

SHARES = (0.0, 0.1, 0.3, 0.5)
PLAIN_SHARE, GROUPED_SHARE, GROUP = 0.3, 0.3, 5
LIMIT = 30.0  # s for each run of a plain solver
SEEDS = (0, 1, 2)
UNSEEN = 3  # a seed that nothing was chosen by
KEYFRAMES = 10_000
EXTENTS = {"sphere2500": 100.0, "parking-garage": 264.0}  # m
HEADER = ("graph", "false loops", "solver", "false kept", "true lost", "error m", "odometry's m", "seconds")


@dataclass(frozen=True)
class Row:
    """One solver on one graph; None where it ran out of time. `error` and `before` [m]: see Case.error."""

    graph: str
    false_loops: str
    solver: str
    false_kept: int | None
    true_lost: int | None
    error: float | None
    before: float
    seconds: float


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("data", type=Path)
    add_results(arguments)
    options = arguments.parse_args()
    data = options.data
    pin_to_one_core()
    cases = [
        posegraph(data / "posegraphs" / "sphere2500.g2o"),
        posegraph(data / "posegraphs" / "parking-garage.g2o"),
        kitti_00(data / "trajectories", sigma=(0.2, 0.05), seed=SEEDS[0]),
        kitti_00(data / "trajectories", sigma=(0.3, 0.10), seed=SEEDS[0]),
    ]
    rows = [row for case in cases for row in measured(case, plain=case is not cases[2])]
    found = {
        "about": surroundings(("numpy", "gtsam")),
        "loops": {case.name: len(case.loops) for case in cases},
        "clean_error": {case.name: case.clean_error() for case in cases if case.optimum is not None},
        "rows": [asdict(row) for row in rows],
        "online": [online(cases[-1].with_false(0.2, SEEDS[0])), online(grown(KEYFRAMES, SEEDS[0]))],
    }
    write_results(options.results, "back_end", found, page)


def measured(case: Case, plain: bool) -> Iterable[Row]:
    """Ours at every share of false loops, alone and in groups that agree; the `plain` solvers at one share."""
    for share in SHARES:
        for seed in (*SEEDS, UNSEEN) if share == PLAIN_SHARE else SEEDS[:1]:
            yield report(solved(case.with_false(share, seed), "ours", f"{share:.0%}, seed {seed}"))
    for seed in (*SEEDS, UNSEEN):
        grouped = case.with_false(GROUPED_SHARE, seed, GROUP)
        yield report(solved(grouped, "ours", f"{GROUPED_SHARE:.0%} in fives, seed {seed}"))
    for solver in ("gnc", "lm", "huber") if plain else ():
        yield report(solved(case.with_false(PLAIN_SHARE, SEEDS[0]), solver, f"{PLAIN_SHARE:.0%}, seed {SEEDS[0]}"))


def report(row: Row) -> Row:
    print(*asdict(row).values(), file=sys.stderr)
    return row


def solved(case: Case, solver: str, false_loops: str) -> Row:
    """In a process of its own, which is ended when a plain solver takes longer than LIMIT."""
    queue: multiprocessing.Queue[Any] = multiprocessing.Queue()
    process = multiprocessing.Process(target=_solve, args=(case, SOLVERS[solver], queue))
    process.start()
    try:
        poses, kept, seconds = queue.get(timeout=None if solver == "ours" else LIMIT)
    except Empty:
        return Row(case.name, false_loops, solver, None, None, None, case.error(case.start), LIMIT)
    finally:
        if process.is_alive():
            process.terminate()
        process.join()
    false_kept = None if kept is None else int(kept[~case.true].sum())
    true_lost = None if kept is None else int((~kept[case.true]).sum())
    return Row(
        case.name, false_loops, solver, false_kept, true_lost, case.error(poses), case.error(case.start), seconds
    )


def _solve(case: Case, solver: Solver, queue: Any) -> None:
    start = process_time()
    poses, kept = solver(case)
    queue.put((poses, kept, process_time() - start))


def _ours(case: Case) -> tuple[Array, Array | None]:
    selection = select_loops(case.odometry, case.loops, case.start)
    return selection.poses, selection.accepted


def _gnc(case: Case) -> tuple[Array, Array | None]:
    """GTSAM's GNC-TLS on the whole graph, at the limit that ours begins from."""
    return gnc(case.odometry, case.loops, case.start, QUANTILES[0.9999])


def _lm(case: Case) -> tuple[Array, Array | None]:
    return optimised(case.odometry, case.loops, case.start), None


def _huber(case: Case) -> tuple[Array, Array | None]:
    return with_huber(case.odometry, case.loops, case.start), None


Solver = Callable[[Case], tuple[Array, Array | None]]
SOLVERS: dict[str, Solver] = {"ours": _ours, "gnc": _gnc, "lm": _lm, "huber": _huber}


def online(case: Case) -> dict[str, Any]:
    """Fed as a drive would: milliseconds of each update, the error before and after the batch solution."""
    back_end, odometry_ms, loop_ms = BackEnd(), [], []
    waiting = sorted(case.loops, key=lambda loop: max(loop.i, loop.j), reverse=True)
    for edge in case.odometry:
        start = perf_counter()
        back_end.add_odometry(edge.pose, edge.covariance)
        odometry_ms.append(1e3 * (perf_counter() - start))
        while waiting and max(waiting[-1].i, waiting[-1].j) <= edge.j:
            loop = waiting.pop()
            start = perf_counter()
            back_end.add_loop(LoopCandidate(loop.i, loop.j, loop.pose), loop.covariance)
            loop_ms.append(1e3 * (perf_counter() - start))
    before = case.error(back_end.poses())
    start = perf_counter()
    back_end.settle()
    return {
        "graph": case.name,
        "poses": len(back_end),
        "loops": len(loop_ms),
        "odometry_ms": list(np.quantile(odometry_ms, [0.5, 0.95])),
        "loop_ms": list(np.quantile(loop_ms, [0.5, 0.95])),
        "settle_s": perf_counter() - start,
        "error_online_m": before,
        "error_m": case.error(back_end.poses()),
    }


def page(found: Mapping[str, Any]) -> str:
    about, versions = found["about"], found["about"]["versions"]
    lines = [
        "# Back end\n",
        f"{about['date']}, {about['cpu']}, {about['cores']} cores, {about['memory_gib']} GiB; "
        + ", ".join(f"{name} {text}" for name, text in versions.items())
        + ".\n",
        f"```\n{about['command']}\n```\n",
        EXPLAINED,
        table(("target", "figure", "limit", "selection"), targets(found)),
        "",
        table(HEADER, [_cells(Row(**row)) for row in found["rows"]], words=3),
        "\nUpdate by update, as while driving, false loops included; median / 95th percentile:\n",
        table(
            ("graph", "poses", "loops", "odometry ms", "loop ms", "settle s", "error online m", "settled m"),
            [_online_cells(row) for row in found["online"]],
        ),
        "\nError of the clean graph (half the sum of squares, GTSAM's): "
        + "; ".join(f"{name} {ours:.6g}, GTSAM {theirs:.6g}" for name, (ours, theirs) in found["clean_error"].items())
        + ". GTSAM uses Levenberg-Marquardt from its chordal initialisation.",
    ]
    return "\n".join(lines)


def targets(found: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Targets: name, worst figure of all runs of our back end, limit, and whether it is met."""
    ours = [row for row in found["rows"] if row["solver"] == "ours"]
    lost = max(row["true_lost"] / found["loops"][row["graph"]] for row in ours)
    off = max(row["error"] / EXTENTS[row["graph"]] for row in ours if row["graph"] in EXTENTS)
    slowest = max(row["seconds"] for row in ours if row["graph"] == "sphere2500")
    ate = max(row["error"] for row in ours if row["graph"] not in EXTENTS)
    updates = found["online"][-1]
    lines = [
        ("false loops kept", sum(row["false_kept"] for row in ours), 0),
        ("true loops lost, at most [%]", 100 * lost, 1),
        ("distance to the clean optimum, at most [% of the extent]", 100 * off, 1),
        ("sphere2500, slowest [s]", slowest, 60),
        ("KITTI 00, ATE [m]", ate, 1),
        ("10,000 keyframes, median update by odometry [ms]", updates["odometry_ms"][0], 5),
        ("10,000 keyframes, median update by a loop [ms]", updates["loop_ms"][0], 5),
    ]
    return [target(name, value, "<=", limit, 2) for name, value, limit in lines]


EXPLAINED = f"""\
* `ours`: slam.graph.loop_selection.select_loops, from odometry to the solved full graph. `gnc`: GTSAM's GNC-TLS on the
  full graph, with the odometry as known inliers. `lm`, `huber`: Levenberg-Marquardt without a kernel, and with Huber's
  ({HUBER}) on loops; both keep every loop. A plain solver is stopped after {LIMIT:.0f} s. One core, processor time in
  seconds.
* A false loop connects two random poses by the relative pose of a random true loop, with an error above 3 m. In fives:
  groups of five that agree with each other through the odometry, as a wrong place seen in five frames does. The reach
  of clusters and the margin of the threshold were chosen on these graphs at seed 0. The final decision by the truncated
  cost was added because of earlier errors on sphere2500 (one false loop kept at seed 0, five and four in fives at seeds
  1 and 2), and its minimum gain because of parking-garage in fives at seeds 0 and 1. Seed {UNSEEN} was used for
  evaluation only.
* The false loop that was kept on sphere2500 has an error of 3.05 m, at a stated noise of 0.3 m. Its squared distance is
  104 from the clean optimum, 43 with the uncertainty of the optimum, but 18 from the graph that it had deformed; the
  limit is 27.9.
* Error: on sphere2500 and parking-garage, the rms distance to the optimum of the clean graph (extents 100 m and 264 m);
  on KITTI 00, the aligned ATE of KISS-ICP's trajectory (4541 poses, 0.03 m / 0.05 deg per frame), with loops from the
  ground truth (within 4 m, more than 100 m of travelled distance apart, every 5th frame) and the noise named. This
  ground truth errs by up to 1 m between the passes of a loop.
"""


def _cells(row: Row) -> tuple[str, ...]:
    out_of_time = row.error is None
    counts = ("-" if value is None else str(value) for value in (row.false_kept, row.true_lost))
    seconds = f"> {row.seconds:.0f}" if out_of_time else number(row.seconds, 1)
    return (row.graph, row.false_loops, row.solver, *counts, number(row.error, 4), number(row.before, 2), seconds)


def _online_cells(row: dict[str, Any]) -> tuple[str, ...]:
    pair = [" / ".join(f"{value:.2f}" for value in row[name]) for name in ("odometry_ms", "loop_ms")]
    ends = [number(row[name], digits) for name, digits in (("settle_s", 1), ("error_online_m", 3), ("error_m", 3))]
    return (row["graph"], str(row["poses"]), str(row["loops"]), *pair, *ends)


if __name__ == "__main__":
    run_script(main)
