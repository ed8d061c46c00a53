"""Search for the extrinsics with the best score, coarse to fine, and their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from slam.calibration.observations import Observations, Parameters, View
from slam.data.cloud import Array
from slam.data.errors import InputError

FOCAL = 720.0  # pixels; the blurs below are for this focal length
COARSE, MIDDLE, FINE = 8.0, (6.0, 2.5), 0.8  # pixels
GRID = np.deg2rad(np.arange(-6.0, 6.1, 1.0))  # about the two axes across the line of sight
ROLLS = np.deg2rad([-5.0, -2.5, 0.0, 2.5, 5.0])  # about it
COARSE_VIEWS, COARSE_EDGES, MOST_EDGES = 12, 300, 600
MIN_EDGES = 40  # a view, on average
#: Change of each parameter that changes the score noticeably.
SCALE = np.array([*np.deg2rad([0.2, 0.2, 0.3]), 0.03, 0.03, 0.05, 0.004, 0.3, 0.3])
DELAY = 6  # its place among the parameters
MAX_CHANGE = np.array([*np.full(3, np.deg2rad(8.0)), *np.full(3, 0.6), 0.06, 0.8, 0.8])
BLOCKS = 10  # of successive views, whose scatter gives the uncertainty
#: Error of an edge that all views of a block have in common [pixels], from the shape of objects and of the beam.
COMMON_ERROR = 0.5


@dataclass(frozen=True, eq=False)
class Fit:
    """The best parameters of some views.

    Attributes:
        at: The parameters.
        sigma: (9,) standard deviations of their changes, in the order of `Parameters.changed`; 0 for those that were
            not estimated.
        score: Score of the parameters at the finest scale.
        score_of_start: The same of the guess.
    """

    at: Parameters
    sigma: Array
    score: float
    score_of_start: float


def coarse(views: Sequence[View], K: Array, start: Parameters) -> Parameters:
    """Search for rotation and translation around a guess that is off by a few degrees and decimetres.

    Args:
        views: The views.
        K: (3, 3) camera matrix.
        start: The guess; its delay is kept.

    Raises:
        InputError: By the guess hardly any LiDAR edges are in the images.
    """
    few = [views[at] for at in np.unique(np.linspace(0, len(views) - 1, COARSE_VIEWS).round().astype(int))]
    scale = K[0, 0] / FOCAL
    observed = Observations(few, K, start.T, COARSE * scale, COARSE_EDGES)
    if len(observed) < MIN_EDGES * len(few):
        raise InputError(
            f"only {len(observed) / len(few):.0f} edges of a scan are in the image by the guess, {MIN_EDGES} are "
            "needed; is the guess within 5 deg, and are the images those of this camera?"
        )
    turns = [start.changed(np.array([*turn, *np.zeros(6)])) for turn in product(GRID, GRID, ROLLS)]
    best = max(turns, key=observed.score)
    observed = Observations(few, K, best.T, MIDDLE[0] * scale, MOST_EDGES)
    turned = maximised(observed, best, range(3))
    observed = Observations(few, K, turned.T, MIDDLE[1] * scale, MOST_EDGES)
    return maximised(observed, turned, range(6))


def fit(views: Sequence[View], K: Array, near: Parameters, start: Parameters, free: Sequence[int]) -> Fit:
    """Estimate the `free` parameters from a place that is `near`, with their uncertainty; `start` is the guess."""
    observed = Observations(views, K, near.T, FINE * K[0, 0] / FOCAL, MOST_EDGES)
    at = maximised(observed, near, free)
    sigma = np.zeros(Parameters.SIZE)
    sigma[list(free)] = np.sqrt(np.diag(covariance(observed, at, free)))
    return Fit(at, sigma, observed.score(at), observed.score(start))


def maximised(observed: Observations, start: Parameters, free: Sequence[int]) -> Parameters:
    """Return the parameters of the highest score; only the `free` ones change."""
    from scipy.optimize import minimize  # slow to import, and the check after a run does not need it

    chosen = list(free)

    def changed(y: Array) -> Parameters:
        change = np.zeros(Parameters.SIZE)
        change[chosen] = y * SCALE[chosen]
        return start.changed(change)

    def cost(y: Array) -> float:
        outside = np.abs(y * SCALE[chosen]) > MAX_CHANGE[chosen]
        return 1.0 if outside.any() else -observed.score(changed(y))

    rough = minimize(cost, np.zeros(len(chosen)), method="Powell", options={"xtol": 0.03, "ftol": 1e-5})
    if len(chosen) == 3:  # a stage on the way
        return changed(rough.x)
    simplex = np.vstack([rough.x, rough.x + 0.3 * np.eye(len(chosen))])
    options = {"xatol": 0.01, "fatol": 1e-7, "maxfev": 40 * len(chosen), "initial_simplex": simplex}
    return changed(minimize(cost, rough.x, method="Nelder-Mead", options=options).x)


def covariance(observed: Observations, at: Parameters, free: Sequence[int]) -> Array:
    """Return the covariance (n, n) of the `free` parameters at a maximum of the score.

    The sum of two: H^-1 G H^-1 with the curvature H of the score and the scatter G of its gradients among BLOCKS blocks
    of views (the sandwich estimator: Huber, 1967); and that of a least-squares fit to edges whose errors of
    COMMON_ERROR pixels are equal within a block, which is large for parameters that move all edges alike.
    """
    chosen, size = list(free), len(free)
    steps = 0.5 * SCALE[chosen]

    def changed(*moves: tuple[int, float]) -> Parameters:
        change = np.zeros(Parameters.SIZE)
        for place, sign in moves:
            change[chosen[place]] += sign * steps[place]
        return at.changed(change)

    plus, minus = ([observed.by_view(changed((i, sign))) for i in range(size)] for sign in (1.0, -1.0))
    H = np.diag([2 * observed.score(at) - up.sum() - down.sum() for up, down in zip(plus, minus, strict=True)])
    for i, j in combinations(range(size), 2):
        corners = (a * b * observed.score(changed((i, a), (j, b))) for a, b in product((1.0, -1.0), repeat=2))
        H[i, j] = H[j, i] = -sum(corners) / 4
    gradient = np.array([(up - down) / 2 for up, down in zip(plus, minus, strict=True)])
    blocks = np.array_split(gradient, min(BLOCKS, gradient.shape[1]), axis=1)
    scatter = len(blocks) * np.cov(np.array([block.sum(axis=1) for block in blocks]).T)
    inverse = _pseudo_inverse(H)
    shifts = np.array([observed.shifts(at, changed((i, 1.0))) for i in range(size)])
    common = COMMON_ERROR**2 / len(blocks) * _pseudo_inverse(shifts @ shifts.T / shifts.shape[1])
    return np.asarray((inverse @ scatter @ inverse + common) * np.outer(steps, steps))


def _pseudo_inverse(H: Array) -> Array:
    """The inverse of a symmetric matrix whose eigenvalues are raised to a millionth of the largest."""
    values, vectors = np.linalg.eigh(H)
    return np.asarray(vectors / np.maximum(values, 1e-6 * max(values.max(), 1e-12)) @ vectors.T)
