"""Speed of two versions of the simulator, and whether they write the same bytes.

    python -m benchmarks.simulation.simulator_speed OLD/bin/lidarlift NEW/bin/lidarlift

Each version is the command `lidarlift` of an environment of its own, so any two commits can be compared. They take
turns: `lidarlift simulate` of a few frames, for what starting takes, and of many; the difference gives frames a second.
Writes simulator_speed.md and .json in benchmarks/results.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.page import surroundings, table, verdict, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.same_bytes import OF_THE_CODE, digests, version
from slam.data.errors import InputError
from slam.data.machine import usable_cores

DRIVES = {
    "loop": ("--drive", "loop"),
    "loop, everything": ("--drive", "loop", "--with-depth", "--distort"),
    "tunnel, VLP-16": ("--drive", "tunnel", "--sensor", "vlp16"),
    "jam": ("--drive", "jam"),
}
FEW = 12  # frames that say what a start takes: as many processes are started for them as for many
VERSIONS = ("before", "after")
AIM = 2.0  # times as many frames a second


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("before", type=Path, help="the command of the older version")
    arguments.add_argument("after", type=Path, help="that of the newer one")
    arguments.add_argument("--frames", type=int, default=160, metavar="N", help="of each drive (default: 160)")
    arguments.add_argument("--rounds", type=int, default=3, metavar="N", help="of all measurements (default: 3)")
    add_results(arguments)
    options = arguments.parse_args()
    commands = dict(zip(VERSIONS, (options.before.absolute(), options.after.absolute()), strict=True))
    found: dict[str, Any] = {name: {"rounds": [], "same": True, "files": 0} for name in DRIVES}
    for number in range(options.rounds):
        for name, words in DRIVES.items():
            turn = _round(commands, words, options.frames, first=VERSIONS[number % 2])
            print(name, turn, file=sys.stderr)
            found[name]["rounds"].append(turn["seconds"])
            found[name]["same"] &= turn["same"]
            found[name]["files"] = turn["files"]
    about = surroundings(("numpy", "numba", "embreex")) | {
        "frames": options.frames,
        "usable_cores": usable_cores(),
        "commits": {name: version(command) for name, command in commands.items()},
    }
    write_results(options.results, "simulator_speed", {"about": about, "drives": found}, page)


def _round(commands: Mapping[str, Path], words: tuple[str, ...], frames: int, first: str) -> dict[str, Any]:
    """Seconds of both versions for FEW frames and for all, and whether all files but the code's digest are the same."""
    seconds: dict[str, dict[str, float]] = {}
    written = {}
    for name in sorted(VERSIONS, key=lambda name: name != first):
        with tempfile.TemporaryDirectory() as folder:
            few = _timed(commands[name], Path(folder) / "few", words, FEW)
            many = _timed(commands[name], Path(folder) / "many", words, frames)
            written[name] = digests(Path(folder) / "many", lambda file: file != OF_THE_CODE)
        seconds[name] = {"few": few, "many": many}
    same = written["before"] == written["after"]
    return {"seconds": seconds, "same": same, "files": len(written["after"])}


def _timed(command: Path, folder: Path, words: tuple[str, ...], frames: int) -> float:
    begin = time.perf_counter()
    run = [str(command), "simulate", str(folder), *words, "--frames", str(frames)]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"{command}: simulate failed: {done.stderr.strip().splitlines()[-1:]}")
    return time.perf_counter() - begin


def rate(turn: Mapping[str, float], frames: int) -> float:
    """Frames a second once it has started."""
    return (frames - FEW) / (turn["many"] - turn["few"])


def page(found: Mapping[str, Any]) -> str:
    """The Markdown page of the JSON file."""
    about = found["about"]
    frames, commits = about["frames"], about["commits"]
    rows = []
    for name, drive in found["drives"].items():
        rates = [{version: rate(turn[version], frames) for version in VERSIONS} for turn in drive["rounds"]]
        ratios = [turn["after"] / turn["before"] for turn in rates]
        whole = [turn["before"]["many"] / turn["after"]["many"] for turn in drive["rounds"]]
        rows.append(
            (
                name,
                *(f"{statistics.median(turn[version] for turn in rates):.1f}" for version in VERSIONS),
                f"{statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})",
                verdict(statistics.median(ratios), ">=", AIM),
                f"{statistics.median(whole):.2f}",
                f"{drive['files']} files the same" if drive["same"] else "differ",
            )
        )
    header = ("sequence", "before", "after", "times as many", f"at least {AIM:g}", "whole command", "bytes")
    return f"""# Speed of the simulator

{about["date"]}, {about["cpu"]}, {about["usable_cores"]} cores, as many processes.
`{about["command"]}`

* Frames per second, including the writing of image and scan; in "everything" also of exact depth and the exact scan,
  with distortion. Before: {commits["before"]}; after: {commits["after"]}. The versions alternate; medians of
  {len(next(iter(found["drives"].values()))["rounds"])} rounds, in brackets minimum and maximum.
* A rate is that of {frames} frames minus {FEW}: the time of the start (imports, the town) is left out. "Whole command"
  is the ratio of the times of `lidarlift simulate --frames {frames}`, including the start.
* Bytes: all files but simulation.json, which contains a digest of the code.

{table(header, rows)}"""


if __name__ == "__main__":
    run_script(main)
