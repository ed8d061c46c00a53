"""Verification of loop candidates on drives with real revisits: acceptance of true and of false candidates.

    python -m benchmarks.loops.loop_verification FOLDER/kitti_00_keyframes FOLDER/nclt_20130110

writes loop_verification.md and .json in benchmarks/results. The JSON is [dataset][clouds][candidates].{count, accepted,
...}, with "about" beside the data sets. One core.
"""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

import numpy as np

from benchmarks.common.page import surroundings, table, without_about, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.places import THINNED, RecordedKeyframes, read_drive
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.loops.scan_context import DEFAULT, ScanContext, levelled, levelled_submap
from slam.loops.verification import Verification, Verifier
from slam.mapping.keyframes import Keyframe
from slam.mapping.visibility import RangeImage
from slam.settings import VerificationSettings

PACKAGES = ("numpy", "scipy", "numba")
RADII = {"kitti_00_keyframes": 4.0, "nclt_20130110": 5.0}  # m, of a revisit
WRONG = 3.0  # m from the reference, which is up to 1 m off itself
ELSEWHERE = 12.0  # m: a candidate so far away is no revisit
FACTORS = (1.2, 1.1, 1.0, 0.9, 0.8, 0.7)  # all thresholds made stricter or looser at once

Candidate = tuple[str, int, int, Array]  # kind, query, match, guess T_match_query
Outcome = tuple[str, float, Verification]  # kind, distance from the reference [m]


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("folders", nargs="+", type=Path, help="unpacked " + " or ".join(RADII))
    add_results(arguments)
    options = arguments.parse_args()
    if unknown := [str(folder) for folder in options.folders if folder.name not in RADII]:
        arguments.error(f"{', '.join(unknown)}: a folder named {' or '.join(RADII)} is expected")
    pin_to_one_core()
    about = surroundings(PACKAGES) | {"settings": VerificationSettings().model_dump()}
    results: dict[str, dict[str, Any]] = {}
    for folder in options.folders:
        drive = read_drive(folder, RADII[folder.name])
        candidates = list(_candidates(drive, np.random.default_rng(0)))
        clouds = {"as they are": drive.clouds} | {name: thin(drive.clouds) for name, thin in THINNED.items()}
        results[folder.name] = {name: _measure(drive, xyz, candidates, name) for name, xyz in clouds.items()}
    write_results(options.results, "loop_verification", {"about": about, **results}, page)


def _candidates(drive: RecordedKeyframes, rng: np.random.Generator) -> Iterator[Candidate]:
    """Every revisit, then wrong ones: alike by scan context, 10 to 40 m further on the same street, at random."""
    distances, way = drive.distances(), drive.travelled
    older = way[:, None] - way >= DEFAULT.min_travelled_distance
    for query in np.flatnonzero(drive.revisits(DEFAULT.min_travelled_distance)):
        match = int(np.where(older[query], distances[query], np.inf).argmin())
        yield "revisits", int(query), match, _disturbed(drive, int(query), match, rng)
    yield from _alike(drive, distances)
    away = (distances > 10) & (np.abs(way[:, None] - way) < 40) & (way[:, None] > way)
    for query, match in rng.permutation(np.argwhere(away))[:250]:
        yield "10-40 m further on", int(query), int(match), _at(drive, query, match, rng.normal(0, [0.05, 2, 2]), True)
    for query, match in rng.permutation(np.argwhere(older & (distances > ELSEWHERE)))[:100]:
        yield "random", int(query), int(match), _at(drive, query, match, rng.normal(0, [1.5, 2, 2]), False)


def _alike(drive: RecordedKeyframes, distances: Array) -> Iterator[Candidate]:
    """The 350 most similar false candidates among the first 8 candidates of every second keyframe."""
    places, found, way = ScanContext(), [], drive.travelled
    for k in range(len(drive.clouds)):
        until = slice(0, k + 1)
        xyz = levelled_submap(drive.clouds[until], drive.odometry[until], way[until], DEFAULT.submap_length)
        if k % 2 == 0:
            found += [(one.distance, k, one) for one in places.query(xyz, way[k])[:8]]
        places.add(xyz, way[k])
    wrong = sorted((one for one in found if distances[one[1], one[2].index] > ELSEWHERE), key=lambda one: one[:2])
    for _, query, candidate in wrong[:350]:
        yield (
            "alike, elsewhere",
            query,
            candidate.index,
            _tilted(drive, query, candidate.index, candidate.relative_pose),
        )


def _disturbed(drive: RecordedKeyframes, query: int, match: int, rng: np.random.Generator) -> Array:
    """The truth as a descriptor tells it: level, up to 4 m off, the yaw by 3 deg of rounding and 3 deg of noise."""
    heading, radius = rng.uniform(0, 2 * np.pi), 4 * np.sqrt(rng.uniform())
    yaw = np.deg2rad(rng.uniform(-3, 3) + rng.normal(0, 3))
    truth = _level_truth(drive, query, match)
    move = truth[:2, 3] + radius * np.array([np.cos(heading), np.sin(heading)])
    return _at(drive, query, match, np.array([yaw, *move]), True)


def _at(drive: RecordedKeyframes, query: int, match: int, yaw_x_y: Array, turned: bool) -> Array:
    """A guess at that place of the match's level frame; `turned`: the true yaw is added."""
    truth = _level_truth(drive, query, match)
    yaw = yaw_x_y[0] + (np.arctan2(truth[1, 0], truth[0, 0]) if turned else 0.0)
    pose = se3.exp(np.array([0, 0, yaw, 0, 0, 0]))
    pose[:2, 3] = yaw_x_y[1:]
    return _tilted(drive, query, match, pose)


def _level_truth(drive: RecordedKeyframes, query: int, match: int) -> Array:
    tilt_query, tilt_match = (se3.inverse(levelled(drive.odometry[k])) @ drive.odometry[k] for k in (query, match))
    return tilt_match @ _truth(drive, query, match) @ se3.inverse(tilt_query)


def _tilted(drive: RecordedKeyframes, query: int, match: int, pose: Array) -> Array:
    """From the level frames, which descriptors know, to the sensors'."""
    tilt_query, tilt_match = (se3.inverse(levelled(drive.odometry[k])) @ drive.odometry[k] for k in (query, match))
    return se3.inverse(tilt_match) @ pose @ tilt_query


def _truth(drive: RecordedKeyframes, query: int, match: int) -> Array:
    return se3.inverse(drive.reference[match]) @ drive.reference[query]


def _measure(
    drive: RecordedKeyframes, clouds: Sequence[Array], candidates: list[Candidate], name: str
) -> dict[str, Any]:
    way, nothing = drive.travelled, RangeImage.of(PointCloud(np.zeros((0, 3)), np.zeros(0)))
    keyframes = [
        Keyframe(k, drive.odometry[k], float(way[k]), PointCloud(xyz, np.zeros(len(xyz))), nothing)
        for k, xyz in enumerate(clouds)
    ]
    verifier, outcomes, milliseconds = Verifier(), [], []
    for kind, query, match, guess in candidates:
        start = time.perf_counter()
        found = verifier.verify(keyframes[: query + 1], query, match, guess)
        milliseconds.append(1000 * (time.perf_counter() - start))
        error = se3.inverse(_truth(drive, query, match)) @ found.T_match_query
        outcomes.append((kind, float(np.linalg.norm(error[:3, 3])), found))
    print(f"{len(clouds)} keyframes, {name}: {np.median(milliseconds):.0f} ms each", file=sys.stderr)
    kinds = {
        kind: _figures([one for one in outcomes if one[0] == kind]) for kind in dict.fromkeys(o[0] for o in outcomes)
    }
    return {"median_ms": float(np.median(milliseconds)), "p95_ms": float(np.percentile(milliseconds, 95)), **kinds}


def _figures(outcomes: list[Outcome]) -> dict[str, Any]:
    by_factor = {}
    for factor in FACTORS:
        errors = [error for _, error, found in outcomes if _passes(found, factor)]
        by_factor[str(factor)] = {"accepted": len(errors), "wrong": sum(error > WRONG for error in errors)}
    return {
        "count": len(outcomes),
        "reasons": dict(Counter(found.reason or "accepted" for *_, found in outcomes)),
        "by_factor": by_factor,
        "worst_accepted_m": max((error for _, error, found in outcomes if found.accepted), default=None),
    }


def _passes(found: Verification, factor: float) -> bool:
    limits = VerificationSettings()
    if found.reason in ("few points", "far from guess"):
        return False
    return (
        found.inlier_ratio >= factor * limits.min_inlier_ratio
        and found.overlap >= factor * limits.min_overlap
        and found.distinctness >= factor * limits.min_distinctness
        and 0 < found.point_sigma <= limits.max_point_sigma / factor
    )


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: the data sets by name, and "about"."""
    about, results = found["about"], without_about(found)
    parts = [
        "# Loop verification\n",
        f"Candidates are verified one by one. {about['cpu']}, one core, load average {about['load_average']}, "
        f"{about['date']}: `{about['command']}`. For revisits, the initial guess is the true pose as a descriptor "
        "gives it: level, up to 4 m away, with a yaw error of 3 deg by rounding and 3 deg (1 sigma) of noise. Alike, "
        f"elsewhere: the most confident errors of scan context, more than {ELSEWHERE:.0f} m away. Figures: the number "
        f"of accepted candidates, and in brackets of those more than {WRONG:.0f} m from the reference, with all four "
        "thresholds made stricter (above 1) or looser by a factor. The default is 1; the smallest factor without a "
        "wrong loop shows its margin. Candidates farther along the street that are accepted within that distance were "
        "corrected by the registration.\n",
    ]
    rows = []
    for dataset, variants in results.items():
        for clouds, kinds in variants.items():
            for kind, figures in kinds.items():
                if isinstance(figures, dict):
                    cells = [f"{one['accepted']} ({one['wrong']})" for one in figures["by_factor"].values()]
                    rows.append([dataset, clouds, kind, str(figures["count"]), *cells, f"{kinds['median_ms']:.0f}"])
    header = ["sequence", "clouds", "candidates", "count", *(f"x {factor}" for factor in FACTORS), "median ms"]
    return "\n".join([*parts, table(header, rows, words=3)])


if __name__ == "__main__":
    run_script(main)
