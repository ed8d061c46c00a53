"""Fuzzing of all parsers of users' files by coverage-guided mutation (atheris).

    python -m benchmarks.inputs.fuzz pcd ply npy bin las laz yaml --minutes 20 --executions 1000000

Needs atheris 3 (pip install atheris), which is not among lidarlift's dependencies: it has wheels for Linux only. A
parser is run on mutations of a few valid files until the number of executions or of minutes is reached. Failures are
any exception but InputError, a file that takes more than five seconds, and memory: every 50th file is measured, and
2 MiB plus twice its size are allowed; for compressed files, twice the size that LZF or LASzip can unpack; for YAML, the
memory of its parser. Files that fail are written to --found, to become cases of tests/inputs.
Writes fuzz.md and .json in benchmarks/results.
"""

from __future__ import annotations

import contextlib
import io
import re
import subprocess
import sys
import tempfile
import tracemalloc
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from slam.data.cloud import PointCloud

POINTS = 40
SECONDS = 5
MEASURED, ALLOWED = 50, 2 << 20
#: What a byte of a file can become where it is compressed.
GROWTH = {"pcd": 88, "laz": 1000, "yaml": 1000}
PARSERS = ("pcd", "ply", "npy", "bin", "las", "laz", "yaml")


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("parsers", nargs="+", choices=PARSERS, help="what is to be fuzzed")
    arguments.add_argument("--minutes", type=float, default=20, metavar="N", help="of each at most (default: 20)")
    arguments.add_argument("--executions", type=int, default=1_000_000, metavar="N", help="of each at most")
    arguments.add_argument("--found", type=Path, default=Path("fuzz_found"), help="where files that failed are put")
    arguments.add_argument("--one", action="store_true", help="run in this process, as the script does with each")
    add_results(arguments)
    options = arguments.parse_args()
    if options.one:
        _fuzz(options.parsers[0], options.minutes, options.executions, options.found)
    found = {name: _of_process(name, options.minutes, options.executions, options.found) for name in options.parsers}
    about = surroundings(("atheris", "numpy", "python-neo-lzf", "laspy", "lazrs", "PyYAML"))
    write_results(options.results, "fuzz", {"about": about, "parsers": found}, page)


def _of_process(name: str, minutes: float, executions: int, found: Path) -> dict[str, Any]:
    """Figures that the fuzzer prints; it ends the process that it runs in."""
    words = [name, "--one", "--minutes", str(minutes), "--executions", str(executions), "--found", str(found)]
    command = [sys.executable, "-m", "benchmarks.inputs.fuzz", *words]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, errors="replace")
    print(done.stderr[-3000:], file=sys.stderr)
    counts = re.findall(r"^#(\d+)\s.*cov: (\d+) ft: (\d+)", done.stderr, re.MULTILINE)
    ended = re.findall(r"stat::number_of_executed_units: *(\d+)", done.stderr)
    seconds = re.findall(r"Done \d+ runs in (\d+) second", done.stderr)
    return {
        "executions": int((ended or [counts[-1][0]])[-1]),
        "edges": int(counts[-1][1]),
        "features": int(counts[-1][2]),
        "seconds": int(seconds[-1]) if seconds else None,
        "failed": done.returncode != 0,
    }


def _fuzz(name: str, minutes: float, executions: int, found: Path) -> None:
    import atheris  # not installed beside lidarlift

    with atheris.instrument_imports(include=["slam.data", "yaml"]):
        read = _reader(name)
    warnings.simplefilter("error", RuntimeWarning)  # numpy warns so about invalid numbers
    found.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for number, content in enumerate(_sound_files(name)):
            (Path(folder) / f"{number}").write_bytes(content)
        limits = [f"-runs={executions}", f"-max_total_time={int(minutes * 60)}", f"-timeout={SECONDS}"]
        kept = [f"-artifact_prefix={found}/{name}-", "-print_final_stats=1", "-max_len=65536", "-rss_limit_mb=2048"]
        atheris.Setup([name, *limits, *kept, folder], _measured(read, GROWTH.get(name, 1)))
        atheris.Fuzz()


def _measured(read: Callable[[bytes], None], growth: int) -> Callable[[bytes], None]:
    """`read`, and an AssertionError where every 50th call takes too much memory."""
    calls = 0

    def once(content: bytes) -> None:
        nonlocal calls
        calls += 1
        if calls % MEASURED:
            read(content)
            return
        tracemalloc.start()
        try:
            read(content)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        assert peak <= ALLOWED + 2 * growth * len(content), f"{peak} bytes of memory for {len(content)}"

    return once


def _reader(name: str) -> Callable[[bytes], None]:
    from slam.data.errors import InputError
    from slam.data.point_files import points_in
    from slam.data.yaml_files import numbers, read_mapping

    def of_points(content: bytes) -> None:
        points = points_in(io.BytesIO(content), Path(f"scan.{name}"))
        assert np.isfinite(points.xyz).all()
        columns = [points.intensity, points.ring, points.colour, *points.times.values()]
        assert all(column is None or len(column) == len(points.xyz) for column in columns)

    def of_yaml(content: bytes) -> None:
        with tempfile.NamedTemporaryFile(dir="/dev/shm", suffix=".yaml") as file:
            file.write(content)
            file.flush()
            with contextlib.suppress(InputError):
                for key, value in read_mapping(Path(file.name), KEYS).items():
                    numbers(Path(file.name), key, value, (-1, 3))

    return of_yaml if name == "yaml" else of_points


KEYS = ("model", "elevation_deg", "K", "T_camera_lidar", "distortion")


def _sound_files(name: str) -> list[bytes]:
    """Some of each kind, to be mutated."""
    from slam.data.point_writer import write_points

    rng = np.random.default_rng(0)
    xyz = rng.uniform(-20, 20, (POINTS, 3)).round(2).astype(np.float32)
    cloud = PointCloud(xyz, rng.random(POINTS), colour=rng.integers(0, 256, (POINTS, 3)))
    if name in ("pcd", "ply", "las", "laz"):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"cloud.{name}"
            fields = {"ring": np.arange(POINTS) % 16, "time": np.arange(POINTS) / 1e3} if name[0] == "p" else {}
            write_points(path, cloud, {key: values.astype(np.float32) for key, values in fields.items()})
            own = path.read_bytes()
        return [own, *(_pcds(xyz) if name == "pcd" else _plys(xyz) if name == "ply" else [])]
    if name == "npy":
        stamped = np.zeros(POINTS, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("t", "u4")])
        stamped["x"], stamped["y"], stamped["z"] = xyz.T
        tables = (xyz, np.asfortranarray(xyz.astype(">f8")), stamped, xyz.reshape(4, -1, 3))
        return [_saved(table) for table in tables]
    if name == "bin":
        wide = np.column_stack([xyz, rng.random(POINTS), np.arange(POINTS) % 16])
        return [wide[:, :width].astype(kind).tobytes() for width in (3, 4, 5) for kind in ("f4", "f8")]
    return [b"model: vlp16\nK: [[700, 0, 600], [0, 700, 180], [0, 0, 1]]\n", b"distortion: &a [1, 2.5e-3, *a]\n"]


def _saved(array: np.ndarray[Any, Any]) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _pcds(xyz: np.ndarray[Any, Any]) -> list[bytes]:
    import lzf

    header = "VERSION 0.7\nFIELDS x y z _ t\nSIZE 4 4 4 1 8\nTYPE F F F U F\nCOUNT 1 1 1 {pad} 1\nWIDTH 20\nHEIGHT 2\n"
    header += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 40\nDATA {data}\n"
    lines = "".join(f"{x} {y} {z} {at}\n" for at, (x, y, z) in enumerate(xyz))
    by_column = xyz.T.tobytes() + np.arange(POINTS, dtype=np.float64).tobytes()
    packed = lzf.compress(by_column) or by_column
    sizes = np.array([len(packed), len(by_column)], np.uint32).tobytes()
    return [
        (header.format(pad=0, data="ascii") + lines).encode(),
        header.format(pad=0, data="binary_compressed").encode() + sizes + packed,
        header.format(pad=4, data="binary").encode() + bytes(24 * POINTS),
    ]


def _plys(xyz: np.ndarray[Any, Any]) -> list[bytes]:
    faces = "element face 2\nproperty list uchar int vertex_index\n"
    header = "ply\nformat {form} 1.0\n{faces}element vertex 40\nproperty float x\nproperty float y\nproperty float z\n"
    lists = "property list uchar ushort neighbours\nend_header\n"
    rows = b"".join(point.tobytes() + b"\2\0\1\0\2" for point in xyz.astype(">f4"))
    lines = "".join(f"{x} {y} {z}\n" for x, y, z in xyz)
    face = b"\3" + np.arange(3, dtype=">i4").tobytes()
    return [
        (header.format(form="ascii", faces=faces) + "end_header\n3 0 1 2\n3 0 1 2\n" + lines).encode(),
        (header.format(form="ascii", faces="") + lists + lines.replace("\n", " 2 5 6\n")).encode(),
        (header.format(form="binary_big_endian", faces=faces) + lists).encode() + face + face + rows,
        (header.format(form="binary_little_endian", faces="") + "end_header\n").encode() + xyz.tobytes(),
    ]


def page(found: Mapping[str, Any]) -> str:
    """The page fuzz.md."""
    about = found["about"]
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    rows = [
        (
            name,
            f"{figures['executions']:,}",
            "-" if figures["seconds"] is None else f"{figures['seconds'] / 60:.1f}",
            str(figures["edges"]),
            str(figures["features"]),
            "yes" if figures["failed"] else "none",
        )
        for name, figures in found["parsers"].items()
    ]
    return f"""# Fuzzing of parsers

{about["date"]}, {about["cpu"]}, {about["cores"]} cores; {versions}.
`{about["command"]}`

* Coverage-guided mutations of a few valid files of each kind, by libFuzzer through atheris. A failure is any exception
  but InputError, a file of up to 64 KiB that takes more than {SECONDS} s, or more memory than 2 MiB plus twice the
  file's size (for compressed files, twice the unpacked size; for YAML, of which at most 64 KiB are read, 1000 times the
  size, which PyYAML needs; measured every {MEASURED}th time).
* Edges and features are libFuzzer's counts of the code reached in `slam.data`, and in PyYAML for YAML.

{table(("parser", "executions", "minutes", "edges", "features", "failures"), rows)}"""


if __name__ == "__main__":
    run_script(main)
