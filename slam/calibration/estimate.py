"""Estimate of a camera's extrinsics: the search, and what of it is determined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.calibration.observations import Parameters, View
from slam.calibration.search import DELAY, coarse, fit
from slam.data.cloud import Array
from slam.data.errors import InputError

MAX_SIGMA = 0.03  # m; a translation with a larger standard deviation is not determined
TRANSLATION = slice(3, 6)  # places among the parameters
MIN_SCORE = 0.15  # a wrong transform reaches 0.05, a right one 0.3 to 0.9
MAX_ROTATION, MAX_TRANSLATION = np.deg2rad(9.0), 0.5  # rad, m; from the guess: farther, the search went astray


@dataclass(frozen=True, eq=False)
class Estimate:
    """Extrinsics of a camera, estimated from several views.

    Attributes:
        T_camera_lidar: (4, 4).
        sigma: (6,) standard deviations: rotation about the camera's axes (right, down, forward) [rad], translation
            along them [m]; 0 where a value is not determined.
        determined: (3,) bool; False where the views do not determine a translation. It is then that of the guess, and
            the rotation is the best one for it.
        delay: Time of the images after the scans' stamps [s].
        delay_sigma: Its standard deviation [s]; 0 if it was given.
        score: Mean strength of image edges at LiDAR edges: 0 as around them, 1 twice as much.
        score_of_guess: The same of the guess.
    """

    T_camera_lidar: Array
    sigma: Array
    determined: Array
    delay: float
    delay_sigma: float
    score: float
    score_of_guess: float


def estimate(views: Sequence[View], K: Array, guess: Array, delay: float | None = None) -> Estimate:
    """Estimate the extrinsics from a guess that is off by at most 5 deg and 20 cm.

    Args:
        views: Scans with their images.
        K: (3, 3) camera matrix of the images.
        guess: (4, 4) T_camera_lidar.
        delay: Time of the images after the scans' stamps [s]; None: estimated, too.

    Raises:
        InputError: By the guess the images show hardly any LiDAR edges, or no alignment is found.
    """
    start = Parameters(guess, delay or 0.0)
    free = [place for place in range(Parameters.SIZE) if place != DELAY or delay is None]
    near = coarse(views, K, start)
    found = fit(views, K, near, start, free)
    determined = found.sigma[TRANSLATION] <= MAX_SIGMA
    if found.score >= MIN_SCORE and not determined.all():
        held = 3 + np.flatnonzero(~determined)
        found = fit(views, K, _held(found.at, guess, held - 3), start, [place for place in free if place not in held])
    change = start.change_to(found.at.T)
    astray = np.linalg.norm(change[:3]) > MAX_ROTATION or np.linalg.norm(change[3:]) > MAX_TRANSLATION
    if found.score < MIN_SCORE or astray:
        raise InputError(
            f"no alignment of LiDAR and image edges found near the guess (score {found.score:.2f}, at least "
            f"{MIN_SCORE} is needed); give a guess within 5 deg and 20 cm, and check that images and scans belong "
            "together"
        )
    sigma, of_delay = found.sigma[:6], float(found.sigma[DELAY])
    return Estimate(found.at.T, sigma, determined, found.at.delay, of_delay, found.score, found.score_of_start)


def _held(at: Parameters, guess: Array, axes: Array) -> Parameters:
    """Parameters with the translations along `axes` of the guess."""
    T = at.T.copy()
    T[axes, 3] = guess[axes, 3]
    return Parameters(T, at.delay, at.side, at.top)
