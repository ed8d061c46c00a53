"""The shipped weights: which recordings they were trained on, which were held out, and the commands.

    python -m benchmarks.weights.train_networks DATA OUT            half resolution, crops: some hours on two CPU cores
    python -m benchmarks.weights.train_networks DATA OUT --full     whole images at full resolution, on a GPU

DATA is the folder with kitti_raw_0013 and the others below, unpacked; towns are simulated. A network learns in two
stages: OUT/squared with the paper's own loss, and from there, with an absolute error added to it, OUT/absolute.
Their cards tell how the shipped weights were made. An interrupted training is resumed when started again; in the
background:

    nohup python -m benchmarks.weights.train_networks DATA OUT > train.log 2>&1 &

Raw drives first get poses from our own odometry: with them neighbouring scans agree better with the scan itself than
with OXTS (0005: 95 % of the depths within 1.7 instead of 3.2 %). KITTI odometry 04 and raw 0005 are for tests alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.script import parser, run_script
from benchmarks.weights.trainings import TOWNS, learn, lidarlift, town
from enrichment.training.pack import Pack, packed
from enrichment.training.samples import Source, source
from slam.data.dataset import open_dataset
from slam.data.errors import InputError

RAW = "kitti_raw_{0}/2011_09_26/2011_09_26_drive_{0}_sync"
RAW_DRIVE = "0013"
MINI = "kitti_odometry_mini/sequences/{}"
SINGLE = ("kitti_stereo2015/sequences/stereo2015", *(MINI.format(name) for name in ("00", "03", "05")))
VALIDATION = tuple(MINI.format(name) for name in ("07", "08", "10"))
TESTS = "KITTI odometry 04", "KITTI raw 2011_09_26_drive_0005"


@dataclass(frozen=True)
class Size:
    """Size of a training: scale of the images, options, and steps and learning rate by network and stage."""

    scale: float
    options: tuple[str, ...]
    stages: dict[str, tuple[tuple[int, float], ...]]


STAGES = "squared", "absolute"
ABSOLUTE = 10  # weight of the absolute error in the second stage
HALF = Size(
    0.5,
    ("--crop", "160x304", "--batch", "4", "--device", "cpu", "--bf16"),
    {
        "l2l": ((400, 1e-2), (800, 1e-2)),
        "li2l": ((1800, 3e-3), (800, 2e-3)),
        "f2l": ((1200, 3e-3), (1600, 2e-3)),
    },
)
FULL = Size(
    1.0,
    ("--crop", "352x1216", "--batch", "8", "--device", "auto"),
    {
        "l2l": ((4000, 1e-2), (8000, 6e-3)),
        "li2l": ((4000, 3e-3), (8000, 2e-3)),
        "f2l": ((4000, 3e-3), (8000, 2e-3)),
    },
)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("data", type=Path)
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--full", action="store_true", help="full resolution, for a GPU")
    arguments.add_argument("--model", action="append", help="only this one; may be given several times")
    options = arguments.parse_args()
    size, out = FULL if options.full else HALF, options.out
    training, validation = packs(options.data, out, size)
    for model in options.model or size.stages:
        train(model, training, validation, out, size)


def train(model: str, training: Sequence[Path], validation: Path, out: Path, size: Size) -> None:
    """One network through all stages; an interrupted training is resumed."""
    start: tuple[object, ...] = ()
    for stage, (steps, rate) in zip(STAGES, size.stages[model], strict=True):
        folder = out / stage / model
        learn(
            model, training, folder, "--validate", validation, "--scale", size.scale, *size.options,
            "--steps", steps, "--rate", rate, *(("--absolute", ABSOLUTE) if start else ()), start=start,
        )  # fmt: skip
        start = "--start", folder / f"{model}.safetensors"


def packs(data: Path, out: Path, size: Size) -> tuple[list[Path], Path]:
    """The files to train on and the one to validate on. Raises InputError as `pack` does."""
    training = [
        pack(out / f"{RAW_DRIVE}.npz", [raw_drive(data, out, RAW_DRIVE, size)]),
        pack(out / "single.npz", sources(data, SINGLE, size)),
        pack(out / "towns.npz", [source(open_dataset(town(out, *each)), None, size.scale) for each in TOWNS]),
    ]
    return training, pack(out / "validation.npz", sources(data, VALIDATION, size))


def raw_drive(data: Path, out: Path, number: str, size: Size) -> Source:
    """A raw drive with the poses of our odometry, which is run where that has not been done."""
    run, path = out / "runs" / number, data / RAW.format(number)
    if not (run / "odometry_kitti.txt").is_file():
        lidarlift("run", path, "--out", run)
    return source(open_dataset(path), run / "odometry_kitti.txt", size.scale)


def sources(data: Path, paths: Sequence[str], size: Size) -> list[Source]:
    return [source(open_dataset(data / path), None, size.scale, neighbours=0) for path in paths]


def pack(path: Path, drives: Sequence[Source]) -> Path:
    """A file with these drives. Raises InputError where one of them is for tests."""
    names = [of.data.name for of in drives]
    for name in set(names) & set(TESTS):
        raise InputError(f"{name} is for tests alone; neither weights nor their choice may depend on it")
    found: Pack = packed(path, drives)
    print(f"{path}: {len(found)} frames of {', '.join(names)}, {path.stat().st_size / 1e6:.1f} MB", flush=True)
    return path


if __name__ == "__main__":
    run_script(main)
