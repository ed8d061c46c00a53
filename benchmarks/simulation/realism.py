"""Recorded and simulated drives compared: statistics of their scans, and the error of odometries on them.

    python -m benchmarks.simulation.realism SEQUENCE [SEQUENCE ...]

writes realism.md, .json and .png (curves) in benchmarks/results. A town is close to the real thing where its figures
lie among those of real drives and systems rank there as they do here.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.odometry.figures import Figures, figures
from benchmarks.odometry.measure import alternate, front_end
from benchmarks.odometry.names import CHANNELS, REFERENCE
from benchmarks.odometry.systems import build
from benchmarks.simulation.realism_page import draw, page
from benchmarks.simulation.scan_figures import scan_figures
from slam.data.dataset import Dataset, open_dataset

COMPARED = ("ndt", REFERENCE)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("datasets", nargs="+", type=Path, metavar="DATASET", help="folder of a drive")
    arguments.add_argument("--scans", type=int, default=40, metavar="N", help="whose looks are measured, of each drive")
    add_results(arguments)
    options = arguments.parse_args()
    results = {path.name: drive_figures(path, options.scans) for path in options.datasets}
    about = surroundings(("numpy", "kiss-icp"))
    write_results(options.results, "realism", {"about": about, **results}, page)
    draw(results, options.results / "realism.png")


def drive_figures(path: Path, scans: int) -> Figures:
    """Statistics of the drive's scans, and the figures of each odometry on them."""
    dataset = open_dataset(path)
    print(f"{path.name}: {scans} of {len(dataset)} scans, then the odometries", file=sys.stderr)
    return {"scans": scan_figures(dataset, scans), "odometry": _odometries(dataset)}


def _odometries(dataset: Dataset) -> Figures:
    """[channels][system] -> figures as in the odometry benchmark; a sensor of 16 rings has no 64."""
    frames = [dataset[position] for position in range(len(dataset))]
    few = dataset.sensor is not None and dataset.sensor.ring_count <= 16
    found: Figures = {}
    for channels in CHANNELS[few:]:
        systems = {name: build(name, channels, dataset) for name in COMPARED}
        runs = alternate(systems, front_end(dataset, frames, channels))
        known = dataset.ground_truth
        found[channels] = {
            name: figures([run], [runs[REFERENCE]], None if known is None else np.asarray(known), None)
            for name, run in runs.items()
        }
    return found


if __name__ == "__main__":
    run_script(main)
