"""Drives side by side, recorded and simulated: what their scans look like, and how odometries do on them.

    python benchmarks/realism.py DRIVE [DRIVE ...]

writes the realism section of benchmarks/RESULTS.md, the same figures as benchmarks/realism.json and as curves. A town
is close to the real thing where its figures lie among those of real drives and systems rank there as they do here.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from figures import Figures, figures
from measure import alternate, front_end
from names import CHANNELS, REFERENCE
from realism_figures import scan_figures
from realism_report import draw, section
from report import surroundings, write_section
from systems import build

from eval.evaluation import write_json
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError

HERE = Path(__file__).parent
COMPARED = ("ndt", REFERENCE)


def main() -> None:
    arguments = _arguments()
    try:
        results = {path.name: drive_figures(path, arguments.scans) for path in arguments.datasets}
    except InputError as error:
        sys.exit(f"error: {error}")
    names = " ".join(path.name for path in arguments.datasets)
    about: dict[str, Any] = surroundings(("numpy", "kiss-icp")) | {"command": f"python benchmarks/realism.py {names}"}
    write_json(arguments.json, {"about": about, **results})
    text = section(results, about)
    write_section(arguments.out, "realism", text)
    draw(results, arguments.json.with_suffix(".png"))
    print(text)


def drive_figures(path: Path, scans: int) -> Figures:
    """How the drive's scans look, and how each system does on them."""
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


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="+", type=Path, metavar="DATASET", help="folder of a drive")
    parser.add_argument("--scans", type=int, default=40, metavar="N", help="whose looks are measured, of each drive")
    parser.add_argument("--json", type=Path, default=HERE / "realism.json", metavar="FILE")
    parser.add_argument("--out", type=Path, default=HERE / "RESULTS.md", metavar="FILE")
    return parser.parse_args()


if __name__ == "__main__":
    main()
