"""Which way a degenerate scan does not hold the pose, as a file has it and as a person says it.

Directions are given as `OdometryStep.unobserved` has them: (K, 6) unit vectors, rotation then translation, in the
sensor's axes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from slam.data.cloud import Array

TOLD = 0.1  # a part of a unit vector below it is what turning and moving have to do with each other, and is not told
TRAVEL, MOVED = np.cos(np.deg2rad(20)), 0.05  # a direction so near to the motion is that of travel; m, of a motion
ALONG = "along x (forward)", "along y (sideways)", "along z (up)"
ABOUT = "about x (roll)", "about y (pitch)", "about z (heading)"
ALONG_TRAVEL = "along the direction of travel"


def translations(unobserved: Array) -> Array:
    """(M, 3) unit vectors: along these the pose is not held. Their largest component is positive."""
    return _units(unobserved[:, 3:])


def rotations(unobserved: Array) -> Array:
    """(M, 3) unit vectors: about these the pose is not held. Their largest component is positive."""
    return _units(unobserved[:, :3])


def directions(unobserved: Array, motion: Array) -> set[str]:
    """For people; `motion` (3,) [m] is how far the sensor moved since the scan before, in its axes, either way."""
    way, named = float(np.linalg.norm(motion)), set()
    for along in translations(unobserved):
        travel = way > MOVED and abs(along @ motion) > TRAVEL * way
        named.add(ALONG_TRAVEL if travel else ALONG[int(np.abs(along).argmax())])
    return named | {ABOUT[int(np.abs(about).argmax())] for about in rotations(unobserved)}


def sentence(found: Sequence[set[str]], frames: int) -> str:
    """For people: the `directions` of each degenerate frame, among so many frames of a run."""
    counts = Counter(name for names in found for name in sorted(names)).most_common()
    always = all(count == len(found) for _, count in counts)
    where = ", ".join(name if always else f"{name} in {count}" for name, count in counts)
    return (
        f"{len(found)} of {frames} frames degenerate: the scan did not hold the pose {where or 'in every direction'}; "
        "the prediction was kept there"
    )


def _units(parts: Array) -> Array:
    """The parts (K, 3) of unit vectors that are large enough to be told, as unit vectors themselves."""
    length = np.linalg.norm(parts, axis=1, keepdims=True)
    told = length[:, 0] > TOLD
    units = parts[told] / length[told]
    largest = np.take_along_axis(units, np.abs(units).argmax(axis=1)[:, None], axis=1)
    return np.asarray(units * np.sign(largest))
