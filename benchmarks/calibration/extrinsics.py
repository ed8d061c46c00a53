"""Extrinsics of the camera from random guesses, compared with those of the data set: success rate and errors.

    python -m benchmarks.calibration.extrinsics DRIVE [DRIVE ...] --guesses 20

writes extrinsics.md and .json in benchmarks/results. A guess is off by up to 5 deg about a random axis and by up to
20 cm in a random direction. Simulated drives have exact extrinsics; those of KITTI are the authors'.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD

os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from lidarlift.calibration_views import chosen_camera, views_of
from lidarlift.reporting import Quiet
from slam.calibration.estimate import estimate
from slam.calibration.observations import Parameters
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.data.errors import InputError

ROTATION, TRANSLATION = np.deg2rad(5.0), 0.2  # of a guess, at most
#: Targets: deg and m.
SIMULATED, RECORDED = (0.1, 0.02), (0.2, 0.03)
AXES = ("pitch", "yaw", "roll", "right", "down", "forward")

NOTES = """
* Rotation, translation: angle and length of the difference, over the determined values; a value that a drive does not
  determine is named by `lidarlift calibrate`, and stays that of the guess.
* Within target: the determined values; in brackets, how often all six were determined and within the target.
* mean error: of each value over all guesses, with its sign; deg about the camera's axes right (pitch), down (yaw) and
  forward (roll), cm along them.
* Delay: of the images after the scans' stamps. KITTI's camera is triggered when the LiDAR looks ahead, the stamp.
"""


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("datasets", nargs="+", type=Path, metavar="DRIVE", help="folder of a drive")
    arguments.add_argument("--guesses", type=int, default=20, help="guesses for each drive")
    add_results(arguments)
    options = arguments.parse_args()
    about = surroundings(("numpy", "scipy", "numba", "opencv-python-headless")) | {"guesses": options.guesses}
    with ProcessPoolExecutor(len(options.datasets)) as pool:
        drives = dict(pool.map(partial(measured, guesses=options.guesses), options.datasets))
    write_results(options.results, "extrinsics", {"about": about, **drives}, page)


def measured(path: Path, guesses: int) -> tuple[str, dict[str, Any]]:
    """The name of a drive and its figures."""
    data = open_dataset(path)
    chosen = chosen_camera(data, None, None)
    _, views = views_of(data, chosen, slice(None), Quiet())
    truth, K = chosen.guess.T_camera_lidar, chosen.guess.K
    rng = np.random.default_rng(0)
    runs = [one_run(views, K, truth, Parameters(truth).changed(_offset(rng)).T) for _ in range(guesses)]
    exact = (data.path.parent.parent / "simulation.json").is_file() or (data.path / "simulation.json").is_file()
    return data.name, {"views": len(views), "exact": exact, "runs": runs}


def one_run(views: Any, K: Array, truth: Array, guess: Array) -> dict[str, Any]:
    """An estimate from one guess: its errors, deg and cm, or why there is none."""
    off = _errors(truth, guess)
    try:
        found = estimate(views, K, guess)
    except InputError as error:
        return {"guess": off, "failed": str(error)}
    sigma = [*np.rad2deg(found.sigma[:3]), *(100 * found.sigma[3:])]
    return {
        "guess": off,
        "error": _errors(truth, found.T_camera_lidar),
        "sigma": [float(value) for value in sigma],
        "determined": [True] * 3 + [bool(sure) for sure in found.determined],
        "delay_ms": 1e3 * found.delay,
        "score": found.score,
    }


def _offset(rng: np.random.Generator) -> Array:
    """A random change (9,) of the parameters: uniform in a ball of rotations and in one of translations."""
    offset = np.zeros(Parameters.SIZE)
    for place, most in ((0, ROTATION), (3, TRANSLATION)):
        direction = rng.normal(size=3)
        offset[place : place + 3] = most * rng.uniform() ** (1 / 3) * direction / np.linalg.norm(direction)
    return offset


def _errors(truth: Array, T: Array) -> list[float]:
    change = Parameters(truth).change_to(T)
    return [*np.rad2deg(change[:3]).tolist(), *(100 * change[3:]).tolist()]


def page(found: Mapping[str, Any]) -> str:
    drives = {name: drive for name, drive in found.items() if name != "about"}
    summary = [_summary(name, drive) for name, drive in drives.items()]
    means = [_means(name, drive) for name, drive in drives.items()]
    head = ("drive", "guesses", "rotation, median [deg]", "max", "translation, median [cm]", "max")
    return (
        f"# Extrinsics of the camera from random guesses\n\n`{found['about']['command']}`\n\n"
        f"{table((*head, 'target', 'within target'), summary)}\n"
        "Mean errors and mean standard deviations that are output; not determined: in how many runs.\n\n"
        f"{table(('drive', *AXES, 'delay [ms]', 'not determined'), means)}{NOTES}"
    )


def _summary(name: str, drive: Mapping[str, Any]) -> tuple[str, ...]:
    runs = [run for run in drive["runs"] if "error" in run]
    degrees, metres = SIMULATED if drive["exact"] else RECORDED
    errors = np.array([np.where(run["determined"], run["error"], 0.0) for run in runs]).reshape(-1, 6)
    turn, shift = np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1)
    good = (turn <= degrees) & (shift <= 100 * metres)
    complete = good & np.array([all(run["determined"]) for run in runs], bool)
    return (
        name,
        str(len(drive["runs"])),
        f"{np.median(turn):.3f}",
        f"{turn.max():.3f}",
        f"{np.median(shift):.1f}",
        f"{shift.max():.1f}",
        f"{degrees} deg, {100 * metres:.0f} cm",
        f"{good.sum()} of {len(drive['runs'])} ({complete.sum()})",
    )


def _means(name: str, drive: Mapping[str, Any]) -> tuple[str, ...]:
    runs = [run for run in drive["runs"] if "error" in run]
    errors, sigma = (np.array([run[key] for run in runs]) for key in ("error", "sigma"))
    sure = np.array([run["determined"] for run in runs])
    cells = [
        f"{errors[sure[:, axis], axis].mean():+.2f} ± {sigma[:, axis].mean():.2f}" if sure[:, axis].any() else "-"
        for axis in range(6)
    ]
    open_ = ", ".join(f"{AXES[axis]} {int((~sure[:, axis]).sum())}" for axis in range(6) if not sure[:, axis].all())
    return name, *cells, f"{np.mean([run['delay_ms'] for run in runs]):+.1f}", open_ or "none"


if __name__ == "__main__":
    run_script(main)
