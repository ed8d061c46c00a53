"""Speed of reading scans from recordings, compared with rosbags' own reader.

    python -m benchmarks.recordings.read_recordings --scans 400

Writes a ROS 1 bag, a SQLite file and an MCAP of the same scans, and reads each in turn: rosbags as it hands over
messages as bytes, and as PointCloud2; ours as clouds, which have rings, times and intensities in our units. Each
measurement is a process of its own. Writes read_recordings.md and .json in benchmarks/results.
"""

from __future__ import annotations

import multiprocessing
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from slam.data.recordings.writer import FORMS, recording_writer

POINTS = 60_000  # of a scan: about those of an Ouster with 64 lines at 1024 columns
TOPIC, PERIOD = "/points", 0.1
FIELDS = np.dtype([*((name, "<f4") for name in ("x", "y", "z", "intensity", "time")), ("ring", "<u2"), ("pad", "<u2")])
WAYS = ("rosbags, bytes", "rosbags, PointCloud2", "lidarlift, clouds", "lidarlift, the last 10")


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--scans", type=int, default=400, metavar="N", help="of a recording (default: 400)")
    arguments.add_argument("--rounds", type=int, default=3, metavar="N", help="of all measurements (default: 3)")
    add_results(arguments)
    options = arguments.parse_args()
    found: dict[str, Any] = {form: {way: [] for way in WAYS} for form in FORMS}
    with tempfile.TemporaryDirectory() as folder:
        for form in FORMS:
            write(Path(folder) / form, form, options.scans)
        for _ in range(options.rounds):
            for form, suffix in FORMS.items():
                for way in WAYS:
                    turn = measured(way, Path(folder) / f"{form}{suffix}", options.scans)
                    print(form, way, turn, file=sys.stderr)
                    found[form][way].append(turn)
    about = surroundings(("numpy", "rosbags")) | {"scans": options.scans, "points": POINTS}
    write_results(options.results, "read_recordings", {"about": about, "forms": found}, page)


def write(path: Path, form: str, scans: int) -> None:
    """Scans of POINTS points, ten a second, all different."""
    rng = np.random.default_rng(0)
    points = np.zeros(POINTS, FIELDS)
    for name in "xyz":
        points[name] = rng.uniform(-50, 50, POINTS)
    points["ring"], points["time"] = np.arange(POINTS) % 64, np.linspace(0, 0.1, POINTS)
    with recording_writer(path, form) as writer:
        for number in range(scans):
            points["intensity"] = number % 256
            stamp = 1_700_000_000 * 10**9 + round(number * PERIOD * 1e9)
            writer.write(TOPIC, stamp, writer.cloud(stamp, "lidar", points))


def measured(way: str, path: Path, scans: int) -> dict[str, float]:
    """Processor seconds until the first scan, and scans per processor second after it, in a new process."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return pool.apply(_measured, (way, path, scans))


def _measured(way: str, path: Path, scans: int) -> dict[str, float]:
    READERS[way](path, 1, lambda: None)  # what is imported is no part of it
    ticks = [time.process_time()]
    READERS[way](path, scans, lambda: ticks.append(time.process_time()))
    rate = (len(ticks) - 2) / (ticks[-1] - ticks[1])
    return {"open_s": round(ticks[1] - ticks[0], 4), "rate": round(rate, 1)}


def _rosbags(path: Path, scans: int, on_scan: Callable[[], None], read: bool) -> None:
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2
    from rosbags.typesys import Stores, get_typestore

    ros1 = path.suffix == ".bag"
    types = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    make = types.deserialize_ros1 if ros1 else types.deserialize_cdr
    with (Reader1 if ros1 else Reader2)(path) as reader:
        for number, (connection, _, data) in enumerate(reader.messages()):
            if read:
                make(data, connection.msgtype)
            on_scan()
            if number + 1 == scans:
                return


def _clouds(path: Path, scans: int, on_scan: Callable[[], None], last: int | None = None) -> None:
    from slam.data.recordings.dataset import RecordedSequence

    data = RecordedSequence(path, start=None if last is None else PERIOD * (scans - last - 0.5))
    for number in range(min(len(data), scans)):
        len(data[number].cloud)
        on_scan()


READERS: dict[str, Callable[[Path, int, Callable[[], None]], None]] = {
    "rosbags, bytes": partial(_rosbags, read=False),
    "rosbags, PointCloud2": partial(_rosbags, read=True),
    "lidarlift, clouds": _clouds,
    "lidarlift, the last 10": partial(_clouds, last=10),
}


def page(found: Mapping[str, Any]) -> str:
    """The page of results."""
    about = found["about"]
    rows = []
    for form, figures in found["forms"].items():
        for way in WAYS:
            opened, rate = (statistics.median(turn[key] for turn in figures[way]) for key in ("open_s", "rate"))
            rows.append((form, way, f"{1000 * opened:.0f}", f"{rate:.0f}"))
    return f"""
# Reading recordings

{about["date"]}, {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]}.
`{about["command"]}`

{about["scans"]} scans of {about["points"]:,} points, not packed, in the cache of the disk. rosbags
({about["versions"]["rosbags"]}) returns bytes or PointCloud2 messages with points as bytes; lidarlift returns
clouds, with intensities, rings and times in its units. Times are those of the processor, which depend little on
other programs; medians of {len(next(iter(found["forms"].values()))[WAYS[0]])} rounds. The time until the first
scan includes opening, for which lidarlift reads the first scans to find the meaning of their columns.

{table(("form", "reading", "until the first scan [ms]", "scans per second after it"), rows, words=2)}
"""


if __name__ == "__main__":
    run_script(main)
