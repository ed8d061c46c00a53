"""Odometry beside its peers on the same scans: speed, accuracy, memory.

    python benchmarks/odometry.py DRIVE [DRIVE ...]

writes the odometry section of benchmarks/RESULTS.md, the same figures as benchmarks/odometry.json and as a picture,
[dataset][system][channels].{median_ms, ate_m, ...}, with "about" beside the data sets. Linux only (pins to a core).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import workers  # none of these starts threads: see pin_to_one_core
from names import SYSTEMS
from report import surroundings, write_section

from slam.data.errors import InputError

HERE = Path(__file__).parent
PACKAGES = ("numpy", "numba", "kiss-icp", "small_gicp", "open3d")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "TBB_NUM_THREADS")


def main() -> None:
    arguments = _arguments()
    try:
        if arguments.memory:
            pin_to_one_core()
            workers.memory(arguments.memory, arguments.datasets[0], _slice(arguments.frames))
        elif arguments.dense:
            workers.dense(arguments.dense, arguments.datasets[0], _slice(arguments.frames))
        else:
            benchmark(arguments)
    except InputError as error:
        sys.exit(f"error: {error}")


def benchmark(arguments: argparse.Namespace) -> None:
    """First what has a process of its own, then everything else on one core, then the report."""
    about: dict[str, Any] = surroundings(PACKAGES) | {"command": _command(arguments), "datasets": {}}
    results: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        alone = [_alone(path, arguments.frames, Path(folder) / f"{i}.npy") for i, path in enumerate(arguments.datasets)]
        pin_to_one_core()

        from comparison import compare  # not before: these bring numpy, numba and the peers
        from measure import UNCOUNTED
        from odometry_report import section
        from picture import draw

        from eval.evaluation import write_json

        about |= {"repeats": arguments.repeats, "uncounted": UNCOUNTED}
        for path, apart in zip(arguments.datasets, alone, strict=True):
            name, entries, facts = compare(path, _slice(arguments.frames), arguments.repeats, *apart)
            results[name], about["datasets"][name] = entries, facts
    write_json(arguments.json, {"about": about, **results})
    write_section(arguments.out, "odometry", section(results, about))
    draw(results, arguments.json.with_suffix(".png"))
    print(f"wrote {arguments.out}, {arguments.json} and its picture")


def pin_to_one_core() -> None:
    """One core and one thread for this process, before libraries start threads of their own."""
    os.environ.update(dict.fromkeys(THREADS, "1"))
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def _alone(path: Path, frames: str, dense: Path) -> tuple[Path | None, dict[str, dict[str, float]]]:
    """The file of the dense trajectory, None where that failed, and the memory of each system, empty where it did."""
    print(f"{path.name}: dense trajectory and memory, in processes of their own", file=sys.stderr)
    done = workers.call(["--dense", str(dense)], path, frames) is not None
    printed = {name: workers.call(["--memory", name], path, frames) for name in SYSTEMS}
    return dense if done else None, {name: json.loads(text) if text else {} for name, text in printed.items()}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="+", type=_folder, metavar="DATASET", help="folder of a drive")
    parser.add_argument("--json", type=Path, default=HERE / "odometry.json", metavar="FILE")
    parser.add_argument("--out", type=Path, default=HERE / "RESULTS.md", metavar="FILE")
    parser.add_argument("--frames", type=_frames, default=":", metavar="A:B", help="only these, as in Python's slices")
    parser.add_argument("--repeats", type=int, default=3, metavar="N")
    parser.add_argument("--memory", metavar="SYSTEM", help=argparse.SUPPRESS)
    parser.add_argument("--dense", type=Path, metavar="FILE", help=argparse.SUPPRESS)
    return parser.parse_args()


def _folder(text: str) -> Path:
    if not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no such folder")
    return Path(text)


def _frames(text: str) -> str:
    try:
        _slice(text)
    except (ValueError, TypeError) as error:
        raise argparse.ArgumentTypeError(f"{text}: write A:B, as in 0:50") from error
    return text


def _slice(text: str) -> slice:
    return slice(*(int(part) if part else None for part in text.split(":", 1)))


def _command(arguments: argparse.Namespace) -> str:
    """The command line without this machine's folders."""
    frames = [] if arguments.frames == ":" else [f"--frames {arguments.frames}"]
    repeats = [] if arguments.repeats == 3 else [f"--repeats {arguments.repeats}"]
    return " ".join(["python benchmarks/odometry.py", *(path.name for path in arguments.datasets), *frames, *repeats])


if __name__ == "__main__":
    main()
