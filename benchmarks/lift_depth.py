"""How well does Lift predict what sixteen of 64 rings do not show, what does the image add, and what does it cost?

    python benchmarks/lift_depth.py kitti_odometry_04 kitti_raw_0005 kitti_raw_0013 \\
        --held-out 0005=FOLDER --held-out 0013=FOLDER --image FOLDER FOLDER FOLDER --blind FOLDER FOLDER FOLDER

beside these drives takes the town's loop (simulated with a camera, once, into the user's cache; another town than those
trained in); writes the lift-depth section of benchmarks/RESULTS.md and benchmarks/lift_depth.json. A held-out FOLDER
has the weights of a training that left this drive out; those of --image and --blind, one a seed, are alike but for the
image, which the blind ones never saw. 04 and 0005 have to be among the drives.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flying_pixels import flying_pixels
from image_gain import blind, image_gain
from lift_depth_report import CLASSICAL, SINGLE, section
from lift_time import WITH, WITHOUT, timed
from lift_weights import held_out, lift_for, lift_of
from report import surroundings, write_section

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from enrichment.methods.registry import LIFT, make_methods
from eval.evaluation import write_json
from lidarlift.cli.depth_benchmark import report_of_drive
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError

HERE = Path(__file__).parent


def main() -> None:
    arguments = _arguments()
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    folders, step = dict(arguments.held_out), arguments.step
    try:
        drives = list(map(open_dataset, arguments.datasets))
        of_image, of_time = (_ending(drives, name) for name in ("04", "0005"))
        depth = [compared(data, folders, step) for data in drives]
        seeds: dict[str, list[Method]] = {
            WITH: [lift_of(folder) for folder in arguments.image],
            WITHOUT: [blind(lift_of(folder)) for folder in arguments.blind],
        }
        image = image_gain(of_image, seeds, step)
        flying = flying_pixels({**make_methods(CLASSICAL), LIFT: lift_of()})
        os.sched_setaffinity(0, cores)
        clock = timed(of_time, lift_for(of_time.name, folders)[1])
    except InputError as error:
        sys.exit(f"error: {error}")
    about = surroundings(("numpy", "numba", "onnxruntime")) | {"step": step}
    found = {
        "about": about, "drives": depth, "image_of": of_image.name, "image": image, "flying_pixels": flying,
        "time_of": of_time.name, "cores_of_time": len(cores), "ms": clock,
    }  # fmt: skip
    write_json(arguments.json, found)
    write_section(arguments.out, "lift-depth", section(found))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="+", type=Path, metavar="DATASET")
    parser.add_argument("--held-out", action="append", type=held_out, default=[], metavar="DRIVE=FOLDER")
    for name in ("--image", "--blind"):
        parser.add_argument(name, nargs="+", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--step", type=int, default=1, metavar="N", help="every Nth frame of the drives")
    parser.add_argument("--out", type=Path, default=HERE / "RESULTS.md", metavar="FILE")
    parser.add_argument("--json", type=Path, default=HERE / "lift_depth.json", metavar="FILE")
    return parser.parse_args()


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
    """depth.json of Lift, with and without the scans before, beside the classical methods."""
    weights, lift = lift_for(data.name, folders)
    methods = {**make_methods(CLASSICAL), LIFT: lift, SINGLE: forgetful(lift)}
    report = report_of_drive(data, methods, slice(None, None, step))
    report["about"]["weights"] = weights
    return report


if __name__ == "__main__":
    main()
