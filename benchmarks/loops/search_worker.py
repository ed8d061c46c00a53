"""One run of the version of lidarlift that the interpreter has installed: the time of each keyframe's loop search.

FOLDER is a data set, or has keyframes/*.bin with odometry_tum.txt. Writes JSON to stdout. search_time.py starts it.
It imports nothing of benchmarks, so that any version of lidarlift can run it.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

from lidarlift.front_ends import front_end_maker
from slam.compilation import compile_kernels
from slam.config import load_config
from slam.data.cloud import Array
from slam.data.dataset import Dataset, open_dataset
from slam.data.folder import UserFolder
from slam.data.pose_files import read_poses
from slam.loops.closing import LoopSearch
from slam.pipeline import Pipeline
from slam.recorded_odometry import RecordedOdometry


def main() -> None:
    arguments = argparse.ArgumentParser(
        prog="python -m benchmarks.loops.search_worker",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("input")
    options = arguments.parse_args()
    folder: Path = options.folder
    config, milliseconds, candidates = load_config(input=options.input), [], []
    search = LoopSearch.next

    def timed(self: LoopSearch, *keyframes: Any) -> Any:  # and in newer versions the odometry
        begin = time.thread_time()
        found = search(self, *keyframes)
        milliseconds.append(1e3 * (time.thread_time() - begin))
        candidates.append(len(found))
        return found

    compile_kernels(config, lambda: None)
    LoopSearch.next = timed  # type: ignore[method-assign, assignment]
    if (folder / "keyframes").is_dir():
        data: Dataset = UserFolder(folder / "keyframes")
        run = Pipeline(config).run(data, recorded=RecordedOdometry(folder / "odometry_tum.txt", len(data)))
        truth: Array | None = read_poses(folder / "reference_tum.txt")[1]
    else:
        data = open_dataset(folder)
        run = Pipeline(config, front_end_maker(config.front_end, data.sensor, data.path)).run(data)
        truth = data.ground_truth
    assert run.mapping is not None
    assert truth is not None
    loops = [record.candidate for record in run.mapping.ledger if record.status == "accepted"]
    found = {
        "milliseconds": milliseconds,
        "candidates": candidates,
        "loops": [(loop.i, loop.j, loop.pose.tolist()) for loop in loops],
        "truth": truth[run.mapping.keyframes.indices].tolist(),
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
