"""Predicted ranges against measured ones: how wrong, how many, and whether their sigma tells the good from the bad."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from slam.data.cloud import Array

BANDS = ((0, 10), (10, 20), (20, 40), (40, 80))  # m of true range
SURE = 0.8  # share of the predictions, those with the smallest sigma, that `at_80` is about
CURVE = np.arange(1, 21) / 20  # shares at which the risk-coverage curve is written down
MOST_RETURNS = 4_000_000  # that `Answers` keeps

#: What the figures of `evaluate` are, for whoever reads them.
PROTOCOL = {
    "error": "predicted minus true range along the ray; over the returns that a prediction exists for",
    "coverage": "share of the held-out returns that a prediction exists for; of trusted: a trusted one",
    "worse": "share of the predictions whose |error| is above 0.3 m, 1 m",
    "iMAE, iRMSE": "of the inverse range, 1/km",
    "AUSE": "mean over k = 1..N of (MAE of the k predictions of smallest sigma - of the k of smallest |error|), in mm",
    "calibration": "share of the predictions with |error| <= sigma; 0.68 if sigma is what it should be; sigma is "
    "scaled by what rings held out of the sparse scan itself ask for, as while driving",
    "past": "methods are shown the same rings of up to five scans before, placed by the drive's true poses, if known",
    "trusted": "the predictions that the method itself holds worth registering",
    "at_80": "the 80 % of the predictions with the smallest sigma",
    "bands": "by true range in metres, from the first number up to the second",
}

#: {"returns", "coverage", "mae_mm", ..., "trusted", "ause_mm", "calibration", "at_80", "risk_coverage", "bands"}
Figures = dict[str, Any]


class Answers:
    """Held-out returns of a drive of so many frames, and what methods said of them; `figures` has a method's each.

    Of more returns than `MOST_RETURNS` each frame keeps its share, evenly spread over its rings.
    """

    def __init__(self, frames: int) -> None:
        self._most = max(MOST_RETURNS // frames, 1)
        self._truth: list[Array] = []
        self._answers: dict[str, list[tuple[Array, ...]]] = {}

    def add(self, truth: Array, answers: Mapping[str, tuple[Array, ...]], which: Array | None = None) -> None:
        """True ranges (M,) of a frame; of each method, the same each time, predicted, sigma and trusted (M,) as in
        `evaluate`; a mask (M,) of the returns that count, by default all."""
        counted = np.arange(len(truth)) if which is None else np.flatnonzero(which)
        thinned = counted[:: max(-(-len(counted) // self._most), 1)]
        self._truth.append(truth[thinned].astype(np.float32))
        for name, parts in answers.items():
            self._answers.setdefault(name, []).append(tuple(part[thinned] for part in parts))

    def figures(self) -> dict[str, Figures]:
        """By method; none where nothing was added."""
        return {
            name: evaluate(np.concatenate(self._truth), *(np.concatenate(part) for part in zip(*parts, strict=True)))
            for name, parts in self._answers.items()
        }


def evaluate(truth: Array, predicted: Array, sigma: Array, trusted: Array) -> Figures:
    """All figures of one method, see `PROTOCOL`; what cannot be computed is None.

    truth      (N,) true ranges [m]
    predicted  (N,) ranges [m], 0 where there is no prediction
    sigma      (N,) metres: half the width of the central 68 % interval of the error, infinite where unknown
    trusted    (N,) bool
    """
    known = predicted > 0
    error = predicted[known].astype(float) - truth[known]
    return {
        **_errors(truth, predicted),
        "trusted": _errors(truth, np.where(trusted, predicted, 0)),
        **_uncertainty(truth[known], error, sigma[known]),
        "bands": {
            f"{low}-{high}": _errors(truth[within], predicted[within])
            for low, high in BANDS
            for within in [(truth >= low) & (truth < high)]
        },
    }


def errors(truth: Array, error: Array) -> Figures:
    """Figures of errors (N,) [m] of ranges or depths whose true values are `truth` (N,) [m]; None where N = 0."""
    inverse = 1000 / (truth + error) - 1000 / truth
    size = np.abs(error)
    return {
        "mae_mm": _mean(1000 * size),
        "rmse_mm": _root_mean_square(1000 * error),
        "imae": _mean(np.abs(inverse)),
        "irmse": _root_mean_square(inverse),
        "median_mm": 1000 * float(np.median(size)) if len(size) else None,
        "worse_0.3m": _mean(size > 0.3),
        "worse_1m": _mean(size > 1.0),
    }


def risk_coverage(size: Array, sigma: Array) -> Array:
    """(N,): mean of the k smallest-sigma sizes (N,), for k = 1..N.

    Among equal sigmas the order says nothing, so each counts with their mean.
    """
    _, group, count = np.unique(sigma, return_inverse=True, return_counts=True)
    mean = np.bincount(group, size) / count
    return np.asarray(np.cumsum(np.repeat(mean, count)) / _ranks(size))


def _errors(truth: Array, predicted: Array) -> Figures:
    known = predicted > 0
    error = predicted[known].astype(float) - truth[known]
    return {"returns": len(truth), "coverage": _mean(known), **errors(truth[known], error)}


def _uncertainty(truth: Array, error: Array, sigma: Array) -> Figures:
    """Whether sigma is right, and whether it sorts; None for methods that do not know."""
    if not np.isfinite(sigma).any():
        return {"ause_mm": None, "calibration": None, "at_80": None, "risk_coverage": None}
    size = np.abs(error)
    risk, oracle = risk_coverage(size, sigma), np.cumsum(np.sort(size)) / _ranks(size)
    surest = np.argsort(sigma, kind="stable")[: round(SURE * len(sigma))]
    at = np.maximum(np.ceil(CURVE * len(size)).astype(int), 1) - 1
    return {
        "ause_mm": 1000 * float(np.mean(risk - oracle)),
        "calibration": _mean(size <= sigma),
        "at_80": errors(truth[surest], error[surest]),
        "risk_coverage": {
            "coverage": CURVE.tolist(),
            "mae_mm": (1000 * risk[at]).tolist(),
            "oracle_mm": (1000 * oracle[at]).tolist(),
        },
    }


def _ranks(values: Array) -> Array:
    return np.arange(1, len(values) + 1)


def _mean(values: Array) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _root_mean_square(values: Array) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else None
