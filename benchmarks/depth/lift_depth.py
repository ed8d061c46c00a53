"""How well does Lift predict what sixteen of 64 rings do not show, what does the image add, and what does it cost?

    python -m benchmarks.depth.lift_depth kitti_odometry_04 kitti_raw_0005 kitti_raw_0013 \\
        --held-out 0005=FOLDER --held-out 0013=FOLDER --image FOLDER FOLDER FOLDER --blind FOLDER FOLDER FOLDER

also takes the town's loop (simulated with a camera, once, into the user's cache; another town than those
trained in); writes lift_depth.md and .json in benchmarks/results. A held-out FOLDER has the weights of a training that
left this drive out; those of --image and --blind, one a seed, are alike but for the image, which the blind ones never
saw. 04 and 0005 have to be among the drives.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.common.cores import pin_to_one_core
from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.depth.flying_pixels import flying_pixels
from benchmarks.depth.image_gain import blind, image_gain
from benchmarks.depth.lift_depth_page import CLASSICAL, SINGLE, page
from benchmarks.depth.lift_time import WITH, WITHOUT, timed
from benchmarks.weights.lift_weights import held_out, lift_for, lift_of
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from enrichment.methods.registry import LIFT, make_methods
from lidarlift.depth_benchmark import sequence_report
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError


def main() -> None:
    options = _options()
    cores = os.sched_getaffinity(0)
    pin_to_one_core()
    folders, step = dict(options.held_out), options.step
    drives = list(map(open_dataset, options.datasets))
    of_image, of_time = (_ending(drives, name) for name in ("04", "0005"))
    depth = [compared(data, folders, step) for data in drives]
    seeds: dict[str, list[Method]] = {
        WITH: [lift_of(folder) for folder in options.image],
        WITHOUT: [blind(lift_of(folder)) for folder in options.blind],
    }
    image = image_gain(of_image, seeds, step)
    flying = flying_pixels({**make_methods(CLASSICAL), LIFT: lift_of()})
    os.sched_setaffinity(0, cores)
    clock = timed(of_time, lift_for(of_time.name, folders)[1])
    about = surroundings(("numpy", "numba", "onnxruntime")) | {"step": step}
    found = {
        "about": about, "drives": depth, "image_of": of_image.name, "image": image, "flying_pixels": flying,
        "time_of": of_time.name, "cores_of_time": len(cores), "ms": clock,
    }  # fmt: skip
    write_results(options.results, "lift_depth", found, page)


def _options() -> argparse.Namespace:
    arguments = parser(__doc__)
    arguments.add_argument("datasets", nargs="+", type=Path, metavar="DATASET")
    arguments.add_argument("--held-out", action="append", type=held_out, default=[], metavar="SEQUENCE=FOLDER")
    for name in ("--image", "--blind"):
        arguments.add_argument(name, nargs="+", type=Path, required=True, metavar="FOLDER")
    arguments.add_argument("--step", type=int, default=1, metavar="N", help="every Nth frame of the drives")
    add_results(arguments)
    return arguments.parse_args()


def _ending(drives: Sequence[Dataset], name: str) -> Dataset:
    for data in drives:
        if data.name.endswith(name):
            return data
    raise InputError(f"no drive {name} among {', '.join(data.name for data in drives)}; name it too")


def forgetful(method: Method) -> Method:
    """The same without the scans before."""

    def momentary(scan: SparseScan, grid: RayGrid) -> Prediction:
        return method(replace(scan, read_past=tuple), grid)

    return momentary


def compared(data: Dataset, folders: Mapping[str, Path], step: int) -> dict[str, Any]:
    """Measure depth.json of Lift, with and without earlier scans, and of the classical methods."""
    weights, lift = lift_for(data.name, folders)
    methods = {**make_methods(CLASSICAL), LIFT: lift, SINGLE: forgetful(lift)}
    report = sequence_report(data, methods, slice(None, None, step)).as_dict()
    report["about"]["weights"] = weights
    return report


if __name__ == "__main__":
    run_script(main)
