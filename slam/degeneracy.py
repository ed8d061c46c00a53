"""Unobservable directions of degenerate scans, in words and for files.

Directions are given as in `OdometryStep.unobserved`: unit vectors (K, 6), rotation then translation, in the sensor's
axes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from slam.data.cloud import Array

MIN_NORM = 0.1  # of the rotation or translation part of a unit vector; smaller parts are coupling and not reported
MIN_TRAVEL_COSINE, MIN_MOTION = np.cos(np.deg2rad(20)), 0.05  # of the direction of travel; m, of a motion
ALONG = "along x (forward)", "along y (sideways)", "along z (up)"
ABOUT = "about x (roll)", "about y (pitch)", "about z (heading)"
ALONG_TRAVEL = "along the direction of travel"


def translations(unobserved: Array) -> Array:
    """Return unit vectors (M, 3) along which the position is unobservable; their largest component is positive."""
    return _units(unobserved[:, 3:])


def rotations(unobserved: Array) -> Array:
    """Return unit vectors (M, 3) about which the rotation is unobservable; their largest component is positive."""
    return _units(unobserved[:, :3])


def directions(unobserved: Array, motion: Array) -> set[str]:
    """Return the names of the unobservable directions.

    Args:
        unobserved: Unit vectors (K, 6).
        motion: Motion (3,) [m] since the last scan, in the sensor's axes; the sign does not matter.
    """
    distance, named = float(np.linalg.norm(motion)), set()
    for along in translations(unobserved):
        travel = distance > MIN_MOTION and abs(along @ motion) > MIN_TRAVEL_COSINE * distance
        named.add(ALONG_TRAVEL if travel else ALONG[int(np.abs(along).argmax())])
    return named | {ABOUT[int(np.abs(about).argmax())] for about in rotations(unobserved)}


def summary(found: Sequence[set[str]], frames: int) -> str:
    """Return a summary about the degenerate frames of a run.

    Args:
        found: The `directions` of each degenerate frame.
        frames: Number of all frames of the run.
    """
    counts = Counter(name for names in found for name in sorted(names)).most_common()
    always = all(count == len(found) for _, count in counts)
    where = ", ".join(name if always else f"{name} in {count}" for name, count in counts)
    return (
        f"{len(found)} of {frames} frames degenerate: the scan did not constrain the pose "
        f"{where or 'in every direction'}; the prediction was kept there"
    )


def _units(parts: Array) -> Array:
    """The parts (K, 3) of unit vectors with at least MIN_NORM, normalised."""
    length = np.linalg.norm(parts, axis=1, keepdims=True)
    reported = length[:, 0] > MIN_NORM
    units = parts[reported] / length[reported]
    largest = np.take_along_axis(units, np.abs(units).argmax(axis=1)[:, None], axis=1)
    return np.asarray(units * np.sign(largest))
