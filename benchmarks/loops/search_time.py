"""Time of the loop search in two versions of lidarlift, and whether they find the same loops.

    python -m benchmarks.loops.search_time OLD/bin/lidarlift NEW/bin/lidarlift KITTI_00 NCLT TOWN:full

Each version is the command `lidarlift` of an environment of its own, as in simulator_speed. A sequence is a folder with
keyframes/*.bin, odometry_tum.txt and reference_tum.txt, or a data set with ground truth and, behind a colon, its input.
Writes search_time.md and .json in benchmarks/results.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.cores import ONE_THREAD
from benchmarks.common.page import surroundings, table, target, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.revisits import WRONG
from benchmarks.same_bytes import version
from slam.data import se3
from slam.data.errors import InputError

VERSIONS = ("before", "after")
WORKER = Path(__file__).with_name("search_worker.py")
LIMIT = 0.25  # of the time before
HEADER = (
    "sequence", "version", "keyframes", "with candidates", "ms a keyframe", "with candidates ms", "95 % ms",
    "without ms", "ratio", "loops", "also before", "wrong", "peak MB",
)  # fmt: skip


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("before", type=Path, help="the command of the older version")
    arguments.add_argument("after", type=Path, help="that of the newer one")
    arguments.add_argument("sequences", nargs="+", metavar="FOLDER[:INPUT]")
    add_results(arguments)
    options = arguments.parse_args()
    commands = dict(zip(VERSIONS, (options.before.absolute(), options.after.absolute()), strict=True))
    found: dict[str, dict[str, Any]] = {}
    for sequence in options.sequences:
        folder, _, channels = sequence.partition(":")
        name = " ".join(filter(None, (Path(folder).name, channels)))
        found[name] = {label: measured(command, folder, channels or "full") for label, command in commands.items()}
        print(name, found[name]["before"]["mean_ms"], found[name]["after"]["mean_ms"], file=sys.stderr)
    about = surroundings(("numpy", "numba")) | {"commits": {name: version(path) for name, path in commands.items()}}
    write_results(options.results, "search_time", {"about": about, "sequences": found}, page)


def measured(command: Path, folder: str, channels: str) -> dict[str, Any]:
    """Figures of one version on one sequence, in a process of its own."""
    words = [str(command.with_name("python")), str(WORKER), str(Path(folder).absolute()), channels]
    with tempfile.TemporaryDirectory() as elsewhere:  # not the repository: the version that is installed counts
        done = subprocess.run(
            words, capture_output=True, text=True, check=False, cwd=elsewhere, env={**os.environ, **ONE_THREAD}
        )
    if done.returncode:
        raise InputError(f"{command}: {folder} failed: {done.stderr.strip().splitlines()[-1:]}")
    raw = json.loads(done.stdout)
    ms, candidates, truth = np.array(raw["milliseconds"]), np.array(raw["candidates"]), np.array(raw["truth"])
    errors = [se3.inverse(np.array(pose)) @ se3.inverse(truth[i]) @ truth[j] for i, j, pose in raw["loops"]]
    return {
        "keyframes": len(ms),
        "with_candidates": int((candidates > 0).sum()),
        "mean_ms": float(ms.mean()),
        "with_ms": float(np.mean(ms[candidates > 0])) if candidates.any() else None,
        "with_p95_ms": float(np.percentile(ms[candidates > 0], 95)) if candidates.any() else None,
        "without_ms": float(np.mean(ms[candidates == 0])) if (candidates == 0).any() else None,
        "loops": [(i, j) for i, j, _ in raw["loops"]],
        "wrong": sum(float(np.linalg.norm(error[:3, 3])) > WRONG for error in errors),
        "peak_mb": raw["peak_mb"],
    }


def page(found: Mapping[str, Any]) -> str:
    """The Markdown page of the JSON file."""
    about, sequences = found["about"], found["sequences"]
    note = f"\n{about['note']}\n" if "note" in about else ""
    rows = [_row(name, label, versions) for name, versions in sequences.items() for label in VERSIONS]
    goals = [
        target(f"{name}: time of a keyframe, relative to before", _ratio(versions), "<=", LIMIT, 2)
        for name, versions in sequences.items()
    ]
    return f"""# Time of the loop search

{about["date"]}, {about["cpu"]}, {about["cores"]} cores.
`{about["command"]}`
{note}
* Processor time of the thread in the loop search of a keyframe: descriptor, places with similar descriptors, and the
  verification of the candidates up to the first that is accepted; mean over the keyframes of the whole run, over those
  with candidates (with the 95th percentile) and over those without. Other threads and programs run at the same time.
* Before: {about["commits"]["before"]}; after: {about["commits"]["after"]}. Each is run once, one after the other, with
  compiled kernels.
* Also before: loops of the same two keyframes that the version before accepted, too. Wrong: loops with an error above
  {WRONG:g} m. Peak: resident memory of the whole run, including the map.

{table(("target", "figure", "limit", "verdict"), goals)}
{table(HEADER, rows, words=2)}"""


def _ratio(versions: Mapping[str, Any]) -> float:
    return float(versions["after"]["mean_ms"] / versions["before"]["mean_ms"])


def _row(name: str, label: str, versions: Mapping[str, Any]) -> tuple[str, ...]:
    figures = versions[label]
    same = {tuple(loop) for loop in versions["before"]["loops"]} & {tuple(loop) for loop in figures["loops"]}
    times = (figures[key] for key in ("mean_ms", "with_ms", "with_p95_ms", "without_ms"))
    return (
        name, label, str(figures["keyframes"]), str(figures["with_candidates"]),
        *("-" if ms is None else f"{ms:.1f}" for ms in times),
        f"{_ratio(versions):.2f}" if label == "after" else "",
        str(len(figures["loops"])), str(len(same)), str(figures["wrong"]), f"{figures['peak_mb']:.0f}",
    )  # fmt: skip


if __name__ == "__main__":
    run_script(main)
