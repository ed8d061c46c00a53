"""The weights of Lift: those that are shipped, those for cross-validation, and what the image adds, from three seeds.

    python -m benchmarks.weights.train_lift DATA OUT        0.8 s a step on a CPU core; 20,000 steps for each of three
    python -m benchmarks.weights.train_lift DATA OUT --only lift

DATA is the folder with kitti_raw_0005 and the others below, unpacked; towns are simulated. OUT gets a folder for each:
lift, without-0005, without-0013, seed-K and seed-K-blind, whose drives have no images. An interrupted training is
resumed when started again. KITTI odometry 04 is for tests alone. docs/lift.md tells how the shipped weights were made.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from benchmarks.common.script import parser, run_script
from benchmarks.weights.train_networks import RAW, SINGLE, VALIDATION
from benchmarks.weights.trainings import TOWNS, learn, town

RAW_DRIVES = "0005", "0013"
STAGES = (16000, 3e-3), (4000, 1e-3)  # steps and highest learning rate
SEEDS, SEED_STEPS = (1, 2, 3), 700
OPTIONS = "--batch", "4", "--bf16", "--device", "auto"


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("data", type=Path)
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--only", help="this one of the trainings")
    options = arguments.parse_args()
    data, out = options.data, options.out
    raw = {number: data / RAW.format(number) for number in RAW_DRIVES}
    other = [*(data / path for path in dict.fromkeys((*SINGLE, *VALIDATION))), *(town(out, *each) for each in TOWNS)]
    trainings = {"lift": [*raw.values(), *other]}
    trainings |= {f"without-{number}": [raw[each] for each in raw if each != number] + other for number in raw}
    for name, drives in trainings.items():
        if options.only in (None, name):
            in_stages(out / name, drives)
    for seed in SEEDS:
        for name, blind in ((f"seed-{seed}", False), (f"seed-{seed}-blind", True)):
            if options.only in (None, name):
                seen = trainings["lift"]
                drives = [without_images(path, out / "blind") for path in seen] if blind else seen
                learn("lift", drives, out / name, *OPTIONS, "--steps", SEED_STEPS, "--seed", seed)


def in_stages(out: Path, drives: Sequence[Path]) -> None:
    """The last one in `out` itself."""
    (steps, rate), (last_steps, last_rate) = STAGES
    learn("lift", drives, out / "first", *OPTIONS, "--steps", steps, "--rate", rate)
    start = out / "first" / "lift.safetensors"
    learn("lift", drives, out, *OPTIONS, "--steps", last_steps, "--rate", last_rate, start=("--start", start))


def without_images(path: Path, out: Path) -> Path:
    """The same drive as symbolic links, without images; with a raw drive's calibration and a sequence's poses."""
    up = 2 if path.parent.name == "sequences" else 1
    copy = out / path.parents[up - 1].relative_to(path.anchor)
    if not copy.exists():
        shutil.copytree(path.parents[up - 1], copy, ignore=shutil.ignore_patterns("image_*"), copy_function=os.symlink)
    return copy / path.relative_to(path.parents[up - 1])


if __name__ == "__main__":
    run_script(main)
