"""Revisits of a recorded drive, and how well place recognition finds them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import read_poses
from slam.loops.scan_context import Candidate, ScanContext, levelled, levelled_submap
from slam.settings import ScanContextSettings

Figures = dict[str, Any]
TIMED = 200  # queries among many places
FAR = 10.0  # m: a candidate beyond is somewhere else; between the radius of a revisit and this it is a near miss


@dataclass(frozen=True, eq=False)
class RecordedKeyframes:
    """Keyframes with odometry and reference, (N, 4, 4) each; a revisit comes within `radius` [m] of an older one."""

    clouds: Sequence[Array]
    odometry: Array
    reference: Array
    radius: float

    @property
    def travelled(self) -> Array:
        """Distance travelled by the odometry, (N,) [m]."""
        return np.r_[0, np.cumsum(np.linalg.norm(np.diff(self.odometry[:, :3, 3], axis=0), axis=1))]

    def revisits(self, min_travelled_distance: float) -> Array:
        """(N,) bool."""
        older = self.travelled[:, None] - self.travelled >= min_travelled_distance
        return np.asarray((older & (self.distances() < self.radius)).any(axis=1))

    def distances(self) -> Array:
        """True distances between keyframes (N, N) [m]."""
        position = self.reference[:, :3, 3]
        return np.linalg.norm(position[:, None] - position, axis=2)


def read_drive(folder: Path, radius: float) -> RecordedKeyframes:
    """A folder with keyframes/*.bin (float32 x, y, z, reflectance), odometry_tum.txt and reference_tum.txt."""
    files = sorted((folder / "keyframes").glob("*.bin"))
    odometry, reference = (read_poses(folder / f"{name}_tum.txt")[1] for name in ("odometry", "reference"))
    if not len(files) == len(odometry) == len(reference):
        raise InputError(
            f"{folder}: {len(files)} keyframes, {len(odometry)} and {len(reference)} poses; as many of each"
        )
    clouds = [np.fromfile(file, np.float32).reshape(-1, 4)[:, :3].copy() for file in files]
    return RecordedKeyframes(clouds, odometry, reference, radius)


def every_fourth_band(clouds: Sequence[Array]) -> list[Array]:
    """Stands in for 16 of 64 rings where these are not known: every fourth band of 0.43 deg of elevation."""
    elevations = [np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))) for xyz in clouds]
    return [xyz[np.floor(at / 0.43).astype(int) % 4 == 0] for xyz, at in zip(clouds, elevations, strict=True)]


def random_half(clouds: Sequence[Array]) -> list[Array]:
    rng = np.random.default_rng(0)
    return [xyz[rng.random(len(xyz)) < 0.5] for xyz in clouds]


def recognise(
    drive: RecordedKeyframes,
    clouds: Sequence[Array],
    settings: ScanContextSettings,
    exhaustive: bool = False,
    raw: bool = False,
) -> Figures:
    """Query and add keyframe by keyframe, and hold the candidates against the reference; `raw`: no submaps."""
    travelled, places = drive.travelled, ScanContext(settings)
    found, milliseconds = [], []
    for k in range(len(clouds)):
        start = time.perf_counter()
        xyz = clouds[k]
        if not raw:
            until = slice(0, k + 1)
            xyz = levelled_submap(clouds[until], drive.odometry[until], travelled[until], settings.submap_length)
        joined = time.perf_counter()
        found.append(places.query(xyz, travelled[k], exhaustive))
        queried = time.perf_counter()
        places.add(xyz, travelled[k])
        milliseconds.append(1000 * np.diff([start, joined, queried, time.perf_counter()]))
    last = np.median(milliseconds[-200:], axis=0)
    frames = drive.reference if raw else np.array([levelled(pose) for pose in drive.reference])
    times = dict(zip(("submap_ms", "query_ms", "add_ms"), last.tolist(), strict=True))
    revisits = drive.revisits(settings.min_travelled_distance)
    return _figures(found, drive.distances(), drive.radius, revisits, frames) | times


def _figures(found: list[list[Candidate]], distances: Array, radius: float, revisit: Array, frames: Array) -> Figures:
    """Recall counts revisits; precision counts the first candidates of all keyframes."""
    asked = np.flatnonzero(revisit)
    hits = [[distances[k, candidate.index] < radius for candidate in found[k]] for k in asked]
    result: Figures = {"revisits": len(hits)}
    result |= {f"recall_top_{n}": float(np.mean([any(hit[:n]) for hit in hits])) for n in (1, 5, 10)}
    near = [distances[k, candidate.index] <= FAR for k in asked for candidate in found[k][:1]]
    first = [(k, candidates[0]) for k, candidates in enumerate(found) if candidates]
    first.sort(key=lambda one: one[1].distance)
    away = np.array([distances[k, candidate.index] for k, candidate in first])
    threshold = np.array([candidate.distance for _, candidate in first])
    right = away < radius
    recall, precision = np.cumsum(right) / len(asked), np.cumsum(right) / np.arange(1, len(first) + 1)
    yaws = np.degrees([_yaw_error(frames, *first[i]) for i in np.flatnonzero(right)])
    return result | {
        "recall_near": sum(near) / len(asked),
        "recall_at_full_precision": float(recall[precision == 1].max(initial=0)),
        "recall_without_far": float(recall[np.cumsum(away > FAR) == 0].max(initial=0)),
        "recall_at_95_percent_precision": float(recall[precision >= 0.95].max(initial=0)),
        "threshold_95_percent_of_right": float(np.percentile(threshold[right], 95)),
        "yaw_error_deg": {"median": float(np.median(yaws)), "p95": float(np.percentile(yaws, 95))},
        "curve": _curve(threshold, recall, precision),
    }


def _curve(threshold: Array, recall: Array, precision: Array) -> dict[str, list[float]]:
    """Recall and precision where the distance threshold is a multiple of 0.01."""
    at = np.arange(1, 61) / 100
    upto = np.searchsorted(threshold, at, side="right") - 1
    at, upto = at[upto >= 0], upto[upto >= 0]
    return {
        "threshold": at.tolist(),
        "recall": recall[upto].round(4).tolist(),
        "precision": precision[upto].round(4).tolist(),
    }


def _yaw_error(frames: Array, query: int, candidate: Candidate) -> float:
    """[rad], not negative; `frames` are the true poses (N, 4, 4) of what was described."""
    true = se3.inverse(frames[candidate.index]) @ frames[query]
    return abs(float((np.arctan2(true[1, 0], true[0, 0]) - candidate.yaw + np.pi) % (2 * np.pi) - np.pi))


def cost(clouds: Sequence[Array], settings: ScanContextSettings, counts: Sequence[int]) -> Figures:
    """Measure scan context with `counts` places, composed of halves of the clouds.

    Returns:
        Median time of a query and of an insertion, and the recall of revisited places by the exhaustive search and by
        the preselected one.
    """
    places, result = ScanContext(settings), {}
    for count in counts:
        milliseconds = []
        while len(places) < count:
            xyz, start = patched(len(places), clouds), time.perf_counter()
            timed = len(places) >= count - TIMED
            if timed:
                places.query(xyz, float(len(places)))
            queried = time.perf_counter()
            places.add(xyz, float(len(places)))
            if timed:
                milliseconds.append(1000 * np.diff([start, queried, time.perf_counter()]))
        result[str(count)] = dict(zip(("query_ms", "add_ms"), np.median(milliseconds, axis=0).tolist(), strict=True))
        result[str(count)] |= _recall(places, clouds)
    return result


def _recall(places: ScanContext, clouds: Sequence[Array]) -> Figures:
    """Share of TIMED places, revisited nearby with half of their points, that each search ranks first."""
    rng, found = np.random.default_rng(0), {"recall": 0.0, "recall_exhaustive": 0.0}
    end = float(len(places)) + places.settings.min_travelled_distance
    for place in rng.choice(len(places), TIMED, replace=False):
        xyz = seen_again(rng, patched(int(place), clouds))
        for name, exhaustive in (("recall", False), ("recall_exhaustive", True)):
            found[name] += (places.query(xyz, end, exhaustive)[0].index == place) / TIMED
    return found


def patched(place: int, clouds: Sequence[Array]) -> Array:
    """A place of its own for each number: the left half of one cloud and the right half of another, each turned."""
    rng, halves = np.random.default_rng(place), []
    for side in (1, -1):
        yaw = rng.uniform(-np.pi, np.pi)
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]], np.float32)
        xyz = clouds[int(rng.integers(len(clouds)))] @ turn
        halves.append(xyz[side * xyz[:, 1] > 0])
    return np.concatenate(halves)


def seen_again(rng: np.random.Generator, xyz: Array) -> Array:
    """Half of the points (N, 3), seen from up to 2 m aside, turned by any angle."""
    aside = se3.exp(np.array([0, 0, rng.uniform(-np.pi, np.pi), *rng.uniform(-1.4, 1.4, 2), 0])).astype(np.float32)
    half = xyz[rng.random(len(xyz)) < 0.5]
    return half @ aside[:3, :3].T + aside[:3, 3]


THINNED: dict[str, Callable[[Sequence[Array]], list[Array]]] = {
    "every fourth elevation band": every_fourth_band,
    "random half of the points": random_half,
}
