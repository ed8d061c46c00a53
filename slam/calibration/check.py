"""Check of given extrinsics and of the camera's delay: a few views, each axis on its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.calibration.observations import Observations, Parameters, View
from slam.calibration.search import DELAY, FOCAL
from slam.data.cloud import Array

AXES = ("pitch", "yaw", "roll")
ANGLES = np.deg2rad(np.arange(-3.0, 3.1, 0.5))
DELAYS = np.arange(-0.2, 0.21, 0.05)  # s
BLUR, EDGES = 2.5, 400  # pixels at the focal length FOCAL; edges of a view
MIN_VIEWS, MIN_EDGES = 5, 40  # edges of a view, on average
#: A finding is at least this far from the given value, and has a score of at least MIN_SCORE and MIN_GAIN times the
#: given one's. Right extrinsics: 0.5 deg at most, gain 1.02; 2 deg off: gain 1.27 and more (KITTI 0005, 0013, a town).
MIN_ANGLE, MIN_DELAY, MIN_SCORE, MIN_GAIN = np.deg2rad(0.9), 0.075, 0.15, 1.15


def camera_fault(views: Sequence[View], K: Array, T: Array) -> str | None:
    """Return what seems to be wrong with the extrinsics or the times of a camera, or None.

    Args:
        views: Scans with their images.
        K: (3, 3) camera matrix.
        T: (4, 4) T_camera_lidar as given.
    """
    if len(views) < MIN_VIEWS:
        return None
    observed = Observations(views, K, T, BLUR * K[0, 0] / FOCAL, EDGES)
    if len(observed) < MIN_EDGES * len(views):
        return None
    given = Parameters(T)
    trials = [(axis, float(size)) for axis in range(3) for size in ANGLES]
    trials += [(DELAY, float(size)) for size in DELAYS]
    axis, size = max(trials, key=lambda trial: observed.score(given.changed(_along(*trial))))
    best, score = observed.score(given.changed(_along(axis, size))), observed.score(given)
    least = MIN_DELAY if axis == DELAY else MIN_ANGLE
    if abs(size) < least or best < max(MIN_SCORE, MIN_GAIN * score):
        return None
    scores = f"score of the edges {score:.2f}, {best:.2f} if corrected"
    if axis == DELAY:
        return f"images appear {abs(size):.2f} s {'late' if size > 0 else 'early'} ({scores}); check their time stamps"
    off = f"{abs(np.rad2deg(size)):.1f} deg in {AXES[axis]}"
    return f"extrinsics appear off by {off} ({scores}); run `lidarlift calibrate`"


def _along(axis: int, size: float) -> Array:
    change = np.zeros(Parameters.SIZE)
    change[axis] = size
    return change
