"""Search for the pose of a scan around one or more poses: after a gap, a failed scan or an implausible registration."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.registration.result import RegistrationResult
from slam.registration.target import Points, Target

STEP = 0.5  # m, below the convergence radius of a coarse cell
YAWS = np.deg2rad([4, -4, 8, -8, 12, -12, 16, -16])  # a sharp corner in one frame
MAX_TRANSLATIONS, MAX_YAWS = 12, 3  # initial guesses that are followed, those with the best score
SOME_POINTS = 1_000  # of a scan, all over it, about: enough to compare and follow the guesses
MIN_RELATIVE_SCORE = 0.5  # of a pose to which a guess led, to the best one; below it is not registered
MAX_REGISTRATIONS = 5  # of a dense scan
MAX_CLIMB = 1.0  # of a pose in place of a registration, to the finest cells: walls fit a storey above and below, too
DISTINCT = 0.4  # distance between two different motions, relative to the finest cells


def search(
    target: Target,
    points: Points,
    centres: list[Array],
    radius: float,
    found: RegistrationResult | None = None,
    needed: float = 1.0,
) -> RegistrationResult:
    """Return the registration with most evidence.

    Turns at the predicted place are always followed: next to sharp walls, a guess that is 1 degree off scores no better
    than others.

    Args:
        target: What the scan is registered to.
        points: The scan.
        centres: Poses (4, 4) around which to search.
        radius: Distance [m] from these up to which initial guesses lie.
        found: The registration from the first of `centres`, for which it was predicted. It is kept unless another has
            more than `needed` times its evidence, at about the predicted height.
        needed: See `found`.
    """
    step = max(1, len(points[0]) // SOME_POINTS)
    candidates = registrations(target, points, centres, radius, step, _turned(centres[0]))
    if found:
        most = MAX_CLIMB * target.convergence_radius
        candidates = [each for each in candidates if _climb(centres[0], each.pose) < most] or [found]
    score = target.scorer(*points, centres[0])
    best = max(candidates, key=lambda candidate: score(candidate.pose))
    return found if found and score(best.pose) <= needed * score(found.pose) else best


def registrations(
    target: Target, points: Points, centres: list[Array], radius: float, step: int = 1, guesses: Sequence[Array] = ()
) -> list[RegistrationResult]:
    """Return the registrations from `centres`, from `guesses`, and from those around `centres` with the best scores.

    Args:
        target: As in `search`.
        points: As in `search`.
        centres: As in `search`.
        radius: As in `search`.
        step: If above 1, every `step`-th point follows the guesses, and all are registered from the distinct poses only
            to which these lead: a third of the time for a dense scan.
        guesses: Further poses (4, 4).
    """
    xyz, weight = (np.ascontiguousarray(values[::step]) for values in points)
    score = target.scorer(xyz, weight, centres[0])
    translations, yaws = _guesses(centres, radius)
    translations.sort(key=score, reverse=True)
    best = non_maximum_suppression(translations, target.convergence_radius)[:MAX_TRANSLATIONS]
    best += [*sorted(yaws, key=score, reverse=True)[:MAX_YAWS], *guesses]
    found = {score(each.pose): each for each in (target.align(xyz, weight, pose) for pose in (*centres, *best))}
    if step == 1:
        return list(found.values())
    likely = [found[key].pose for key in sorted(found, reverse=True) if key >= MIN_RELATIVE_SCORE * max(found)]
    distinct = non_maximum_suppression(likely, DISTINCT * target.convergence_radius)[:MAX_REGISTRATIONS]
    return [target.align(*points, pose) for pose in distinct]


def _guesses(centres: list[Array], radius: float) -> tuple[list[Array], list[Array]]:
    """Poses moved in eight directions, and poses moved ahead and turned."""
    translations, yaws = [], []
    for centre in centres:
        for distance in np.arange(0.0, radius + 1e-9, STEP):
            yaws += _turned(centre, distance)
            for heading in np.arange(8 if distance else 1) * np.pi / 4:
                offset = np.eye(4)
                offset[:2, 3] = distance * np.cos(heading), distance * np.sin(heading)
                translations.append(centre @ offset)
    return translations, yaws


def _turned(centre: Array, distance: float = 0.0) -> list[Array]:
    """Poses moved ahead by a distance [m], and turned."""
    return [centre @ se3.exp(np.array([0, 0, yaw, distance, 0, 0])) for yaw in YAWS]


def _climb(predicted: Array, pose: Array) -> float:
    """Distance [m] of a position from the sensor's predicted horizontal plane, in which the guesses lie."""
    return abs(float(predicted[:3, 2] @ (pose - predicted)[:3, 3]))


def non_maximum_suppression(poses: list[Array], distance: float) -> list[Array]:
    """Return the poses, in order of their scores, that are at least `distance` [m] from all better ones."""
    kept: list[Array] = []
    places: list[list[float]] = []
    for pose in poses:
        place = pose[:3, 3].tolist()
        if all(math.dist(other, place) >= distance for other in places):
            kept.append(pose)
            places.append(place)
    return kept
