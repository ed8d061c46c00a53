"""Time of reading a scan, compared with Open3D's reader.

    python -m benchmarks.inputs.read_speed --points 120000

A scan of random points with intensity, ring and time is written in each format. Ours reads it as `run` does, into a
PointCloud with rings and times; Open3D's reads it into its tensors, and these into NumPy's arrays. The two alternate,
on one core, with the file in the system's cache. Writes read_speed.md and .json in benchmarks/results.
"""

from __future__ import annotations

import os

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, target, write_results
from benchmarks.common.script import add_results, parser, run_script
from slam.data.cloud import Array, PointCloud
from slam.data.dataset import open_dataset
from slam.data.point_writer import write_points

ROUNDS = 41
AIM = 5.0  # times as fast with a binary .pcd
FORMATS = {"binary": "PCD, binary", "ascii": "PCD, text", "ply": "PLY, binary", "npy": "NPY", "bin": "BIN"}


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--points", type=int, default=120_000, metavar="N", help="of the scan (default: 120000)")
    add_results(arguments)
    options = arguments.parse_args()
    pin_to_one_core()
    with tempfile.TemporaryDirectory() as folder:
        found = {name: _measured(path) for name, path in _written(Path(folder), options.points).items()}
    about = surroundings(("numpy", "open3d", "python-neo-lzf")) | {"points": options.points, "import_s": _imports()}
    write_results(options.results, "read_speed", {"about": about, "formats": found}, page)


def _written(folder: Path, count: int) -> dict[str, Path]:
    """A scan in each format, in a folder of its own."""
    rng = np.random.default_rng(0)
    azimuth, reach = rng.uniform(-np.pi, np.pi, count), rng.uniform(3, 80, count)
    xyz = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), rng.uniform(-2, 3, count)])
    cloud = PointCloud(xyz, rng.random(count))
    ring, stamps = np.arange(count) % 64, np.linspace(0, 0.1, count)
    fields: dict[str, Array] = {"ring": ring.astype(np.uint16), "time": stamps.astype(np.float32)}
    paths = {name: folder / name / f"000000.{'pcd' if name in ('binary', 'ascii') else name}" for name in FORMATS}
    for path in paths.values():
        path.parent.mkdir()
    write_points(paths["binary"], cloud, fields)
    write_points(paths["ply"], cloud, fields)
    columns = np.column_stack([cloud.xyz, cloud.intensity, ring, stamps]).astype(np.float32)
    header = paths["binary"].read_bytes().partition(b"binary\n")[0].decode() + "ascii\n"
    with paths["ascii"].open("w", encoding="ascii") as file:
        file.write(header)
        np.savetxt(file, columns, "%.4f %.4f %.4f %.4f %d %.6f")
    names = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4"), ("ring", "f4"), ("time", "f4")]
    np.save(paths["npy"], columns.view(names)[:, 0])
    columns.tofile(paths["bin"])
    return paths


def _measured(path: Path) -> dict[str, Any]:
    """Milliseconds of both readers, median and least; Open3D has none for .npy and .bin."""
    import open3d as o3d

    data = open_dataset(path.parent)

    def ours() -> PointCloud:
        return data[0].cloud

    def theirs() -> list[Any]:
        with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
            cloud = o3d.t.io.read_point_cloud(path)
        return [cloud.point[name].numpy() for name in cloud.point]

    readers: dict[str, Callable[[], Any]] = {"ours": ours}
    if path.suffix in (".pcd", ".ply"):
        readers["open3d"] = theirs
    spent: dict[str, list[float]] = {name: [] for name in readers}
    for _ in range(ROUNDS):
        for name, read in readers.items():
            start = time.perf_counter()
            read()
            spent[name].append(1e3 * (time.perf_counter() - start))
    print(path.name, {name: round(statistics.median(each), 2) for name, each in spent.items()}, file=sys.stderr)
    return {name: {"median_ms": statistics.median(each), "least_ms": min(each)} for name, each in spent.items()}


def _imports() -> dict[str, float]:
    """Seconds that a fresh interpreter takes to import what reads points; the least of five."""
    found = {}
    for name, module in {"ours": "slam.data.point_files", "open3d": "open3d"}.items():
        program = f"import numpy, time; a = time.perf_counter(); import {module}; print(time.perf_counter() - a)"
        runs = [subprocess.run([sys.executable, "-c", program], capture_output=True, check=True) for _ in range(5)]
        found[name] = min(float(run.stdout) for run in runs)
    return found


def page(found: Mapping[str, Any]) -> str:
    """The page read_speed.md."""
    about, formats = found["about"], found["formats"]
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    rows, pcd = [], formats["binary"]
    for name, times in formats.items():
        ours, theirs = times["ours"], times.get("open3d")
        row = [FORMATS[name], f"{ours['median_ms']:.1f}", f"{ours['least_ms']:.1f}"]
        if theirs is None:
            row += ["-", "-", "-"]
        else:
            ratio = theirs["median_ms"] / ours["median_ms"]
            row += [f"{theirs['median_ms']:.1f}", f"{theirs['least_ms']:.1f}", f"{ratio:.1f}"]
        rows.append(row)
    ratio = pcd["open3d"]["median_ms"] / pcd["ours"]["median_ms"]
    aim = target("binary PCD into a PointCloud, times as fast as Open3D", ratio, ">=", AIM, 1)
    return f"""# Speed of reading a scan

{about["date"]}, {about["cpu"]}, one core of {about["cores"]}, load average {about["load_average"]}; {versions}.
`{about["command"]}`

* {about["points"]:,} points with x, y, z, intensity, ring and time. Ours: `open_dataset(folder)[0].cloud`, with rings
  and times as `run` has them. Open3D: `t.io.read_point_cloud` and its tensors as NumPy's arrays; it drops the ring of
  the PLY, a ushort, and has no reader for .npy and .bin. The two alternate, {ROUNDS} times.
* Import of the reader, without numpy: {about["import_s"]["ours"]:.2f} s; of open3d: {about["import_s"]["open3d"]:.2f}
  s.

{table(("format", "ours, ms", "minimum", "Open3D, ms", "minimum", "times as fast"), rows)}
{table(("target", "found", "aim", ""), [aim], words=1)}"""


if __name__ == "__main__":
    run_script(main)
