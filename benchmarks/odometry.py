"""Odometry beside its peers on the same scans: speed, accuracy, memory.

    python benchmarks/odometry.py DRIVE [DRIVE ...]

writes the odometry section of benchmarks/RESULTS.md and the same figures as benchmarks/odometry.json,
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

import workers  # nothing here may start numpy's, numba's or anyone's threads: see pin_to_one_core

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
    with tempfile.TemporaryDirectory() as folder:
        dense_files = [_dense(path, arguments.frames, Path(folder) / f"{i}.npy") for i, path in _each(arguments)]
        memories = [_memory(path, arguments.frames) for _, path in _each(arguments)]
        pin_to_one_core()

        from odometry_report import section
        from report import surroundings, write_section

        from eval.evaluation import write_json

        about: dict[str, Any] = surroundings(PACKAGES) | {"command": _command(arguments), "repeats": arguments.repeats}
        about["datasets"] = {}
        results: dict[str, Any] = {}
        for i, path in _each(arguments):
            _drive(path, arguments, dense_files[i], memories[i], results, about)
    write_json(arguments.json, {"about": about, **results})
    write_section(arguments.out, "odometry", section(results, about))
    print(f"wrote {arguments.out} and {arguments.json}")


def pin_to_one_core() -> None:
    """One core and one thread for this process, before libraries start threads of their own."""
    os.environ.update(dict.fromkeys(THREADS, "1"))
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def _drive(
    path: Path,
    arguments: argparse.Namespace,
    dense_file: Path | None,
    memory: dict[str, dict[str, float]],
    results: dict[str, Any],
    about: dict[str, Any],
) -> None:
    """Measure one data set and put it into `results` and `about`."""
    import numpy as np
    from figures import figures
    from measure import UNCOUNTED, measure, warm_up
    from systems import CHANNELS, REFERENCE, SYSTEMS

    from eval.trajectory import path_length
    from slam.data.dataset import open_dataset

    dataset = open_dataset(path)
    positions = np.arange(len(dataset))[_slice(arguments.frames)]
    frames = [dataset[position] for position in positions]
    truth = None if dataset.ground_truth is None else dataset.ground_truth[positions]
    known = None if truth is None else truth[np.isfinite(truth[:, 0, 0])]
    dense = None if dense_file is None else np.load(dense_file)
    if not results:
        warm_up(dataset, frames)
    about["uncounted"] = UNCOUNTED
    about["datasets"][dataset.name] = {
        "frames": len(frames),
        "truth_path_length_m": None if known is None else path_length(known),
        "dense": dense is not None,
    }
    entries: dict[str, Any] = {name: {} for name in SYSTEMS}
    for channels in CHANNELS:
        runs = measure(dataset, frames, channels, arguments.repeats)
        for name in SYSTEMS:
            entries[name][channels] = figures(runs[name], runs[REFERENCE], truth, dense)
    for name in SYSTEMS:
        entries[name]["64"].update(memory[name])
    results[dataset.name] = entries


def _each(arguments: argparse.Namespace) -> list[tuple[int, Path]]:
    return list(enumerate(arguments.datasets))


def _dense(path: Path, frames: str, file: Path) -> Path | None:
    print(f"{path.name}: dense yardstick", file=sys.stderr)
    return file if workers.call(["--dense", str(file)], path, frames) is not None else None


def _memory(path: Path, frames: str) -> dict[str, dict[str, float]]:
    print(f"{path.name}: memory", file=sys.stderr)
    printed = {name: workers.call(["--memory", name], path, frames) for name in workers.SYSTEMS}
    return {name: json.loads(text) if text else {} for name, text in printed.items()}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="+", type=_folder, metavar="DATASET", help="folder of a drive")
    parser.add_argument("--json", type=Path, default=HERE / "odometry.json", metavar="FILE")
    parser.add_argument("--out", type=Path, default=HERE / "RESULTS.md", metavar="FILE")
    parser.add_argument("--frames", default=":", metavar="A:B", help="only these, as in Python's slices")
    parser.add_argument("--repeats", type=int, default=3, metavar="N")
    parser.add_argument("--memory", metavar="SYSTEM", help=argparse.SUPPRESS)
    parser.add_argument("--dense", type=Path, metavar="FILE", help=argparse.SUPPRESS)
    return parser.parse_args()


def _folder(text: str) -> Path:
    if not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no such folder")
    return Path(text)


def _slice(text: str) -> slice:
    return slice(*(int(part) if part else None for part in text.split(":")))


def _command(arguments: argparse.Namespace) -> str:
    """The command line without this machine's folders."""
    frames = [] if arguments.frames == ":" else [f"--frames {arguments.frames}"]
    repeats = [] if arguments.repeats == 3 else [f"--repeats {arguments.repeats}"]
    return " ".join(["python benchmarks/odometry.py", *(path.name for path in arguments.datasets), *frames, *repeats])


if __name__ == "__main__":
    main()
