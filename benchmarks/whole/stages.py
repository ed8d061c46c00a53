"""Whole runs of two versions of lidarlift by stage: milliseconds of each stage, processor time, wall time, memory.

    python -m benchmarks.whole.stages BEFORE AFTER SEQUENCE [SEQUENCE ...]

BEFORE and AFTER are the commands lidarlift of two environments, .venv/bin/lidarlift for instance. Their runs alternate,
pinned to one core. Where py-spy is installed, a further run of AFTER is sampled, and the page has the shares of its
parts. Writes stages.md and .json in benchmarks/results. Linux only.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

from benchmarks.common.page import surroundings, table, without_about, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.odometry.drive_arguments import add_drives
from benchmarks.whole.processes import INPUTS, alternated, run_of
from eval.text import number

MEASURES = {"processor_s": "processor time s", "wall_s": "wall time s", "memory_mb": "peak memory MB"}
VERSIONS = ("before", "after")
STAGES = ("load", "front_end", "odometry", "waiting", "map", "loops", "back_end")
#: Parts of a run, by a piece of a frame of their stacks.
PARTS = {
    "imports": "<module>",
    "kernels from the cache": "(numba/core/",
    "reading": "__getitem__ (slam/data/",
    "enrichment": "(enrichment/",
    "odometry": "register (slam/odometry.py",
    "keyframes": "(slam/gathering.py",
    "loops": "(slam/loops/",
    "graph": "(slam/graph/",
    "map": "build_map",
    "session": "(slam/journal/",
    "camera check": "camera_problems",
    "metrics": "evaluate_run",
    "map.png": "map_png",
    "trajectory.png": "plot_run",
    "report": "report_run",
}
OUTERMOST = ("(lidarlift/__main__.py", "(lidarlift:")  # of the command: these have a <module>, too
IDLE = ("wait (threading.py", "get (queue.py", "_worker (concurrent/futures/")
LEAST_SHARE = 0.01  # of the samples: below it a part is not on the page


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("before", type=Path, metavar="BEFORE", help="the command lidarlift of the earlier version")
    arguments.add_argument("after", type=Path, metavar="AFTER", help="the command lidarlift of this version")
    add_drives(arguments)
    arguments.add_argument("--inputs", nargs="+", default=list(INPUTS), choices=INPUTS)
    arguments.add_argument("--repeats", type=int, default=2, metavar="N")
    add_results(arguments)
    options = arguments.parse_args()
    found: dict[str, Any] = {"about": surroundings(("numpy", "numba", "gtsam", "matplotlib"))}
    pin_to_one_core()
    for sequence in options.datasets:
        found[sequence.name] = {}
        for input in options.inputs:
            versions = {
                name: partial(run_of, getattr(options, name), sequence, input, options.frames) for name in VERSIONS
            }
            pair = alternated(versions, options.repeats)
            sampled = samples(options.after, sequence, input, options.frames) if shutil.which("py-spy") else {}
            found[sequence.name][input] = pair | {"shares": sampled}
            print(sequence.name, input, pair, file=sys.stderr)
    write_results(options.results, "stages", found, page)


def samples(program: Path, sequence: Path, input: str, frames: str) -> dict[str, float]:
    """Run a sequence under py-spy, and return the shares of its parts, see `shares`."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "stacks.txt"
        sampler = ("py-spy", "record", "--format", "raw", "--rate", "50", "--nonblocking", "--output", str(file), "--")
        run_of(program, sequence, input, frames, sampler)
        return shares(file.read_text(encoding="utf-8"))


def shares(stacks: str) -> dict[str, float]:
    """Return the share of each of PARTS in stacks as py-spy writes them: frames by semicolons, a space, a count.

    A sample counts for the innermost of its frames that is of a part; those of threads that wait do not count.
    """
    counts: Counter[str] = Counter()
    for line in stacks.splitlines():
        stack, _, times = line.rpartition(" ")
        frames = stack.split(";")
        if not any(idle in frames[-1] for idle in IDLE):
            counts[_part(frames)] += int(times)
    total = counts.total()
    return {name: count / total for name, count in counts.most_common() if count >= LEAST_SHARE * total}


def _part(frames: list[str]) -> str:
    for frame in reversed(frames):
        for part, piece in PARTS.items():
            if piece in frame and not any(outermost in frame for outermost in OUTERMOST):
                return part
    return "other"


def page(found: Mapping[str, Any]) -> str:
    """Make the page."""
    about = found["about"]
    rows = [
        row
        for sequence, inputs in without_about(found).items()
        for input, pair in inputs.items()
        for row in _rows(sequence, input, pair["before"], pair["after"])
    ]
    shared = [
        (sequence, input, ", ".join(f"{name} {100 * share:.0f} %" for name, share in pair["shares"].items()))
        for sequence, inputs in without_about(found).items()
        for input, pair in inputs.items()
        if pair["shares"]
    ]
    title = "Parts of this version's run, shares of py-spy's samples"
    spied = f"\n## {title}\n\n{table(('sequence', 'input', 'shares'), shared, words=3)}" if shared else ""
    return f"""# Stages of a whole run

{about["date"]}, {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]} at the beginning.
`{about["command"]}`

* `lidarlift run` of two versions, each a process of its own, everything included: imports, kernels from the cache,
  SLAM, metrics, figures and report. The runs alternate on one core, one thread each; of the runs of a version, the one
  with the least processor time counts. The wall time contains what else the machine did.
* The stages are those of run.json, medians of wall times: load, front end, odometry and waiting per frame; map, loops
  and back end per keyframe. Memory is the peak of the process.

{table(("sequence", "input", "", "before", "after", "ratio"), rows, words=3)}{spied}"""


def _rows(sequence: str, input: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> list[tuple[str, ...]]:
    pairs = {text: (before[name], after[name]) for name, text in MEASURES.items()}
    for stage in STAGES:
        if stage in before["stages"] and stage in after["stages"]:
            pairs[f"{stage} ms"] = (before["stages"][stage], after["stages"][stage])
    return [
        (sequence, input, text, number(old, 2), number(new, 2), number(new / old if old else float("nan"), 2))
        for text, (old, new) in pairs.items()
    ]


if __name__ == "__main__":
    run_script(main)
