"""Keys that preselect places among 10,000: the share of revisited places that is lost, for several keys.

    python -m benchmarks.loops.ring_keys KITTI_00 NCLT

takes the clouds of kitti_00_keyframes and nclt_20130110, composes places of halves of them as place_recognition does,
and writes ring_keys.md and .json in benchmarks/results. One core.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import surroundings, table, target, without_about, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.places import patched, read_drive, seen_again
from slam.data.cloud import Array
from slam.loops import kernels
from slam.loops.scan_context import DEFAULT, HARMONICS, descriptor, ring_key, shifted_descriptors

PLACES, QUERIES = 10_000, 600
LIMIT = 1.0  # % that may be lost


def _mean(contexts: Array) -> Array:
    return np.asarray(contexts.mean(axis=-1))


def _with_occupancy(contexts: Array) -> Array:
    """A filled bin counts as a metre."""
    return np.concatenate([_mean(contexts), (contexts > 0).mean(axis=-1)], axis=-1)


def _with_harmonics(count: int) -> Callable[[Array], Array]:
    """The mean, then the amplitudes of the first harmonics, as in `ring_key`."""

    def key(contexts: Array) -> Array:
        waves = 2 * np.abs(np.fft.rfft(contexts, axis=-1)[..., 1 : count + 1]) / contexts.shape[-1]
        return np.concatenate([_mean(contexts), waves.reshape(*contexts.shape[:-2], -1)], axis=-1)

    return key


USED = f"mean and {HARMONICS} harmonics (ours)"
KEYS: dict[str, Callable[[Array], Array]] = {
    "mean (before)": _mean,
    "mean and occupancy": _with_occupancy,
    "mean and 1 harmonic": _with_harmonics(1),
    "mean and 2 harmonics": _with_harmonics(2),
    USED: ring_key,
    "mean and 6 harmonics": _with_harmonics(6),
}


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    add_results(arguments)
    options = arguments.parse_args()
    pin_to_one_core()
    results = {folder.name: measured(folder) for folder in options.folders}
    about = surroundings(("numpy", "numba")) | {"places": PLACES, "queries": QUERIES}
    write_results(options.results, "ring_keys", {"about": about, **results}, page)


def measured(folder: Path) -> dict[str, Any]:
    """Loss and time of each key on places of this folder's clouds."""
    clouds = read_drive(folder, radius=4.0).clouds
    stored = np.array([descriptor(patched(place, clouds)) for place in range(PLACES)])
    rng = np.random.default_rng(0)
    places = rng.choice(PLACES, QUERIES, replace=False)
    queries = [shifted_descriptors(seen_again(rng, patched(int(place), clouds))) for place in places]
    found = {}
    for name, key in KEYS.items():
        keys, ranks, milliseconds = key(stored).astype(np.float32), [], []
        for place, contexts in zip(places, queries, strict=True):
            begin = time.process_time()
            unlike = kernels.key_distances(key(contexts).astype(np.float32), keys, PLACES)
            milliseconds.append(1e3 * (time.process_time() - begin))
            ranks.append(int((unlike < unlike[place]).sum()))
        lost = {str(most): float(np.mean(np.array(ranks) >= most)) for most in (25, 50, 100)}
        found[name] = {"numbers": keys.shape[1], "lost": lost, "ms": float(np.median(milliseconds))}
        print(folder.name, name, found[name], file=sys.stderr)
    return found


def page(found: Mapping[str, Any]) -> str:
    """The Markdown page of the JSON file."""
    about, results = found["about"], without_about(found)
    rows = [
        (
            folder,
            name,
            str(key["numbers"]),
            *(f"{100 * share:.2f}" for share in key["lost"].values()),
            f"{key['ms']:.2f}",
        )
        for folder, keys in results.items()
        for name, key in keys.items()
    ]
    most = str(DEFAULT.max_preselected)
    goals = [
        target(f"{folder}: lost with {most} preselected [%]", 100 * keys[USED]["lost"][most], "<=", LIMIT, 2)
        for folder, keys in results.items()
    ]
    return f"""# Ring keys

{about["date"]}, {about["cpu"]}, one core.
`{about["command"]}`

* {about["places"]:,} places, each half of one cloud and half of another, with a random yaw; {about["queries"]} of them
  are seen again with half of their points, from up to 2 m to the side and turned by any angle. Lost: the share of these
  for which at least 25, 50 or 100 other places have a nearer key, to the key of any of the five lateral shifts; the
  search compares the {most} nearest. NCLT's clouds have half of the points of KITTI's.
* Numbers: length of a key, 4 bytes each. ms: processor time of one query's comparison with all keys.

{table(("target", "figure", "limit", "verdict"), goals)}
{table(("clouds", "key", "numbers", "lost of 25 %", "of 50", "of 100", "ms"), rows, words=2)}"""


if __name__ == "__main__":
    run_script(main)
