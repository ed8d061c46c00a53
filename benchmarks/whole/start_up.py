"""Times from the start of a command to its help, and to the first frame of a run, of two versions of lidarlift.

    python -m benchmarks.whole.start_up BEFORE AFTER SEQUENCE

BEFORE and AFTER are the commands lidarlift of two environments. They take turns. The first frame is there when the
progress bar says so, in a terminal of its own; the run ends then. Cold runs have an empty cache of kernels. Writes
start_up.md and .json in benchmarks/results. Linux only.
"""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.common.page import surroundings, table, verdict, write_results
from benchmarks.common.script import add_results, parser, run_script
from eval.text import number
from slam.data.errors import InputError

#: What is timed, with the limit [s].
TARGETS = {"lidarlift --help": 0.5, "first frame": 1.5, "first frame, cold": 8.0}
VERSIONS = ("before", "after")
FIRST = re.compile(rb"\b[1-9]\d*/\d+\b")  # of the progress bar
ESCAPES = re.compile(rb"\x1b\[[0-9;?]*[A-Za-z]")
HEADER = ("what", "before s", "after s", "ratio", "limit", "")


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("before", type=Path, metavar="BEFORE", help="the command lidarlift of the earlier version")
    arguments.add_argument("after", type=Path, metavar="AFTER", help="the command lidarlift of this version")
    arguments.add_argument("sequence", type=Path, metavar="SEQUENCE")
    arguments.add_argument("--repeats", type=int, default=3, metavar="N")
    add_results(arguments)
    options = arguments.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed program has byte code
    found: dict[str, Any] = {"about": surroundings(("numpy", "numba", "gtsam"))}
    programs = {version: getattr(options, version).absolute() for version in VERSIONS}
    sequence = options.sequence.absolute()
    makers: dict[str, Callable[[Path], float]] = {
        "lidarlift --help": time_of_help,
        "first frame": partial(time_to_first_frame, sequence=sequence),
        "first frame, cold": partial(cold, sequence=sequence),
    }
    for program in programs.values():
        time_to_first_frame(program, sequence)  # makes byte code and kernels
    for what, make in makers.items():
        times: dict[str, list[float]] = {version: [] for version in VERSIONS}
        for _ in range(options.repeats):
            for version, program in programs.items():
                times[version].append(make(program))
        found[what] = {version: {"median_s": median(each), "all_s": each} for version, each in times.items()}
        print(what, found[what], file=sys.stderr)
    write_results(options.results, "start_up", found, page)


def time_of_help(program: Path) -> float:
    """Return the wall time [s] of `lidarlift --help`."""
    begin = time.perf_counter()
    subprocess.run([program, "--help"], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def cold(program: Path, sequence: Path) -> float:
    """Return the wall time [s] to the first frame with an empty cache of kernels."""
    with tempfile.TemporaryDirectory() as cache:
        return time_to_first_frame(program, sequence, {"NUMBA_CACHE_DIR": cache})


def time_to_first_frame(program: Path, sequence: Path, environment: Mapping[str, str] | None = None) -> float:
    """Return the wall time [s] from the start of `lidarlift run` until its progress bar shows a frame.

    Raises:
        InputError: The run ended before.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = (str(program), "run", str(sequence), "--out", f"{folder}/run")
        return _until(FIRST, command, os.environ | dict(environment or {}))


def _until(pattern: re.Pattern[bytes], command: Sequence[str], environment: Mapping[str, str]) -> float:
    """Run a command in a terminal until it has printed a pattern, and return the time [s]."""
    ours, theirs = pty.openpty()
    begin = time.perf_counter()
    process = subprocess.Popen(
        command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, start_new_session=True
    )
    os.close(theirs)
    printed = b""
    try:
        while not pattern.search(ESCAPES.sub(b"", printed)):
            if select.select([ours], [], [], 0.01)[0]:
                printed += os.read(ours, 65536)
            elif process.poll() is not None:
                raise InputError(f"{command[0]} ended before its first frame: {printed.decode(errors='replace')}")
        return time.perf_counter() - begin
    except OSError as error:  # the terminal is closed when the command ends
        raise InputError(f"{command[0]} ended before its first frame: {printed.decode(errors='replace')}") from error
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        os.close(ours)


def page(found: Mapping[str, Any]) -> str:
    """Make the page."""
    about = found["about"]
    return f"""# Start

{about["date"]}, {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]} at the beginning.
`{about["command"]}`

* Wall time from the start of the command: to the end of `lidarlift --help`, and until the progress bar of `lidarlift
  run` shows the first frame. The versions take turns, on all cores; medians. The bar is drawn ten times a second.
* The kernels lie in the cache, as after `make setup` or a first run; cold runs have an empty cache. Both versions have
  their byte code.

{table(HEADER, _rows(found))}"""


def _rows(found: Mapping[str, Any]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for what, limit in TARGETS.items():
        before, after = (found[what][version]["median_s"] for version in VERSIONS)
        judged = (f"≤ {limit:g}", verdict(after, "≤", limit))
        rows.append((what, number(before, 2), number(after, 2), number(after / before, 2), *judged))
    return rows


if __name__ == "__main__":
    run_script(main)
