"""Memory and bytes that reading a long recording takes, by its size, and those that a part near its end takes.

    python -m benchmarks.recordings.long_recordings --megabytes 500 --factors 1 4 16

For each form a recording of that size is written by repeating scans, then one 4 and one 16 times as long, and each is
read by a process of its own: all its clouds, and the 60 s that begin 90 s before its end. Recordings are deleted one by
one; the largest must fit on the disk. Writes long_recordings.md and .json in benchmarks/results.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.recordings.read_recordings import FIELDS, PERIOD, POINTS, write
from slam.data.recordings.writer import FORMS

PART, BEFORE_END = 60.0, 90.0  # s of a part, and from its start to the recording's end
SCAN_BYTES = POINTS * FIELDS.itemsize


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--megabytes", type=int, default=500, metavar="N", help="of the shortest (default: 500)")
    arguments.add_argument("--factors", type=int, nargs="+", default=[1, 4, 16], metavar="N", help="default: 1 4 16")
    arguments.add_argument("--forms", nargs="+", choices=FORMS, default=[*FORMS], help="default: all")
    arguments.add_argument("--folder", type=Path, metavar="FOLDER", help="for the recordings (default: temporary)")
    add_results(arguments)
    options = arguments.parse_args()
    found: dict[str, Any] = {}
    for form in options.forms:
        for factor in options.factors:
            with tempfile.TemporaryDirectory(dir=options.folder) as folder:
                path = Path(folder) / f"drive{FORMS[form]}"
                scans = factor * options.megabytes * 10**6 // SCAN_BYTES
                write(path.with_suffix(""), form, scans)
                start = max(scans * PERIOD - BEFORE_END, 0.0)
                figures = {
                    "size_mb": round(path.stat().st_size / 1e6),
                    "scans": scans,
                    "all": measured(path, None),
                    "part": measured(path, start),
                }
            print(form, factor, figures, file=sys.stderr)
            found.setdefault(form, {})[str(factor)] = figures
    about = surroundings(("numpy", "rosbags")) | {"points": POINTS}
    write_results(options.results, "long_recordings", {"about": about, "forms": found}, page)


def measured(path: Path, start: float | None) -> dict[str, float]:
    """Read all clouds, or a part from `start` [s] on, in a new process.

    Returns:
        scans, seconds to open, seconds altogether, bytes read [MB], peak memory [MB].
    """
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_measured, (path, start))


def _measured(path: Path, start: float | None) -> dict[str, float]:
    from slam.data.recordings.dataset import RecordedSequence

    read, began = _bytes_read(), time.perf_counter()
    data = RecordedSequence(path, start=start, duration=None if start is None else PART)
    opened = time.perf_counter()
    for position in range(len(data)):
        len(data[position].cloud)
    return {
        "scans": len(data),
        "open_s": round(opened - began, 3),
        "seconds": round(time.perf_counter() - began, 3),
        "read_mb": round((_bytes_read() - read) / 1e6, 1),
        "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000),
    }


def _bytes_read() -> int:
    """Bytes that this process has read from files, cached ones too (Linux)."""
    lines = Path("/proc/self/io").read_text(encoding="ascii").splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("rchar")))


def page(found: Mapping[str, Any]) -> str:
    """The page of results."""
    about = found["about"]
    rows = [
        (
            form,
            f"{figures['size_mb']:,}",
            f"{figures['scans']:,}",
            f"{figures['all']['memory_mb']}",
            f"{figures['part']['memory_mb']}",
            f"{figures['part']['scans']}",
            f"{figures['part']['read_mb']:,.0f}",
        )
        for form, sizes in found["forms"].items()
        for figures in sizes.values()
    ]
    reading = ("memory, all [MB]", "memory, part [MB]", "scans of the part", "read for it [MB]")
    return f"""
# Long recordings

{about["date"]}, {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]}.
`{about["command"]}`

Scans of {about["points"]:,} points, {SCAN_BYTES / 1e6:.2f} MB each, ten a second, not packed. Peak memory of a process
that reads all clouds, and of one that reads the {PART:.0f} s that begin {BEFORE_END:.0f} s before the end
(`--start`, `--duration`); the bytes that the latter reads from the file, including the index of all messages, of which
the part's own clouds are {PART / PERIOD * SCAN_BYTES / 1e6:,.0f} MB.

{table(("form", "size [MB]", "scans", *reading), rows)}
"""


if __name__ == "__main__":
    run_script(main)
