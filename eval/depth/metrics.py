"""Metrics of predicted ranges against measured ones: errors, coverage, and calibration and ranking by sigma."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from slam.data.cloud import Array

BANDS = ((0, 10), (10, 20), (20, 40), (40, 80))  # m of true range
AT_COVERAGE = 0.8  # share of the predictions, by smallest sigma, that `at_80` is measured on
CURVE = np.arange(1, 21) / 20  # shares at which the risk-coverage curve is sampled
MAX_RETURNS = 4_000_000  # that `Predictions` keeps in memory

#: Definitions of the figures of `range_figures`, printed with them.
PROTOCOL = {
    "error": "predicted minus true range along the ray, over the held-out returns that have a prediction",
    "coverage": "share of the held-out returns that have a prediction; for trusted: a trusted one",
    "worse": "share of the predictions whose |error| is above 0.3 m, 1 m",
    "iMAE, iRMSE": "errors of the inverse range, 1/km",
    "AUSE": "mean over k = 1..N of (MAE of the k predictions of smallest sigma - of the k of smallest |error|), in mm",
    "calibration": "share of the predictions with |error| <= sigma, ideally 0.68; sigma is scaled by online "
    "calibration on held-out rings of the sparse scan, as in a run",
    "past": "methods receive the same rings of up to five scans before, transformed by the true poses, if known",
    "trusted": "the predictions that the method marks as accurate enough for registration",
    "at_80": "the 80 % of the predictions with the smallest sigma",
    "bands": "by true range in metres, from the first number up to the second",
}


@dataclass(frozen=True)
class Errors:
    """Errors of predicted ranges or depths; each is None without predictions.

    Attributes:
        mae_mm: Mean absolute error [mm].
        rmse_mm: Root mean square error [mm].
        imae: Mean absolute error of the inverse [1/km].
        irmse: Root mean square error of the inverse [1/km].
        median_mm: Median absolute error [mm].
        worse_0_3m: Share of the predictions with an error above 0.3 m, 0..1.
        worse_1m: Share of the predictions with an error above 1 m, 0..1.
    """

    mae_mm: float | None
    rmse_mm: float | None
    imae: float | None
    irmse: float | None
    median_mm: float | None
    worse_0_3m: float | None
    worse_1m: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON."""
        names = ("mae_mm", "rmse_mm", "imae", "irmse", "median_mm")
        shares = {"worse_0.3m": self.worse_0_3m, "worse_1m": self.worse_1m}
        return {name: getattr(self, name) for name in names} | shares


@dataclass(frozen=True)
class ReturnErrors(Errors):
    """Errors of predictions for held-out returns.

    Attributes:
        returns: Number of held-out returns.
        coverage: Share of them that have a prediction, 0..1; None without held-out returns.
    """

    returns: int
    coverage: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON."""
        return {"returns": self.returns, "coverage": self.coverage, **super().as_dict()}


@dataclass(frozen=True)
class RiskCoverage:
    """Risk-coverage curve: the error of the share of predictions with the smallest sigma, at the shares `CURVE`.

    Attributes:
        coverage: Shares of the predictions, 0..1.
        mae_mm: Mean absolute error of each share, sorted by sigma [mm].
        oracle_mm: Mean absolute error of each share, sorted by the error itself [mm]: a lower bound for any sigma.
    """

    coverage: tuple[float, ...]
    mae_mm: tuple[float, ...]
    oracle_mm: tuple[float, ...]


@dataclass(frozen=True)
class RangeFigures(ReturnErrors):
    """All figures of one method over held-out returns, see `PROTOCOL`; those that need sigma are None without it.

    Attributes:
        trusted: Errors of the predictions that the method marks as accurate enough for registration.
        ause_mm: Area under the sparsification error curve [mm].
        calibration: Share of the predictions with |error| <= sigma, 0..1.
        at_80: Errors of the 80 % of the predictions with the smallest sigma.
        risk_coverage: Risk-coverage curve.
        bands: Errors by true range, "0-10" to "40-80" m.
    """

    trusted: ReturnErrors
    ause_mm: float | None
    calibration: float | None
    at_80: Errors | None
    risk_coverage: RiskCoverage | None
    bands: Mapping[str, ReturnErrors]

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON."""
        return {
            **super().as_dict(),
            "trusted": self.trusted.as_dict(),
            "ause_mm": self.ause_mm,
            "calibration": self.calibration,
            "at_80": self.at_80 and self.at_80.as_dict(),
            "risk_coverage": self.risk_coverage and asdict(self.risk_coverage),
            "bands": {name: errors.as_dict() for name, errors in self.bands.items()},
        }


class Predictions:
    """Predictions of several methods for the held-out returns of a sequence.

    If there are more returns than `MAX_RETURNS`, each frame keeps an equal number, evenly spread over its rings.

    Args:
        frames: Number of frames that will be added.
    """

    def __init__(self, frames: int) -> None:
        self._most = max(MAX_RETURNS // frames, 1)
        self._truth: list[Array] = []
        self._predictions: dict[str, list[tuple[Array, ...]]] = {}

    def add(self, truth: Array, predictions: Mapping[str, tuple[Array, ...]], which: Array | None = None) -> None:
        """Add the returns of a frame.

        Args:
            truth: True ranges (M,) [m].
            predictions: Predicted range, sigma and trusted (M,) of each method, as in `range_figures`; the same methods
                for every frame.
            which: (M,) bool, which returns count; by default all.
        """
        counted = np.arange(len(truth)) if which is None else np.flatnonzero(which)
        thinned = counted[:: max(-(-len(counted) // self._most), 1)]
        self._truth.append(truth[thinned].astype(np.float32))
        for name, parts in predictions.items():
            self._predictions.setdefault(name, []).append(tuple(part[thinned] for part in parts))

    def figures(self) -> dict[str, RangeFigures]:
        """Return the figures by method; empty if nothing was added."""
        return {
            name: range_figures(
                np.concatenate(self._truth), *(np.concatenate(part) for part in zip(*parts, strict=True))
            )
            for name, parts in self._predictions.items()
        }


def range_figures(truth: Array, predicted: Array, sigma: Array, trusted: Array) -> RangeFigures:
    """Compute all figures of predicted ranges along rays with known returns; see `PROTOCOL` for the definitions.

    Args:
        truth: True ranges (N,) [m].
        predicted: Predicted ranges (N,) [m], 0 where not predicted.
        sigma: Half the width of the central 68 % interval of the error (N,) [m], infinite where unknown.
        trusted: (N,) bool, whether the method marks its prediction as accurate enough for registration.

    Returns:
        The figures; None where one cannot be computed.

    Example:
        >>> figures = range_figures(
        ...     truth=np.array([10.0, 20.0]),
        ...     predicted=np.array([10.5, 0.0]),
        ...     sigma=np.array([0.2, np.inf]),
        ...     trusted=np.array([True, False]),
        ... )
        >>> figures.mae_mm, figures.coverage, figures.calibration, figures.bands["20-40"].coverage
        (500.0, 0.5, 0.0, 0.0)
    """
    known = predicted > 0
    error = predicted[known].astype(float) - truth[known]
    bands = {f"{low}-{high}": (truth >= low) & (truth < high) for low, high in BANDS}
    return RangeFigures(
        **vars(_return_errors(truth, predicted)),
        trusted=_return_errors(truth, np.where(trusted, predicted, 0)),
        **_uncertainty(truth[known], error, sigma[known]),
        bands={name: _return_errors(truth[within], predicted[within]) for name, within in bands.items()},
    )


def errors(truth: Array, error: Array) -> Errors:
    """Compute the errors of predictions.

    Args:
        truth: True ranges or depths (N,) [m].
        error: Predicted minus true (N,) [m].

    Returns:
        The figures, each None if N = 0.

    Example:
        >>> found = errors(np.array([10.0, 10.0, 10.0]), np.array([0.5, -0.5, 2.0]))
        >>> found.mae_mm, found.median_mm, round(found.worse_1m, 3)
        (1000.0, 500.0, 0.333)
    """
    inverse = 1000 / (truth + error) - 1000 / truth
    size = np.abs(error)
    return Errors(
        mae_mm=_mean(1000 * size),
        rmse_mm=_root_mean_square(1000 * error),
        imae=_mean(np.abs(inverse)),
        irmse=_root_mean_square(inverse),
        median_mm=1000 * float(np.median(size)) if len(size) else None,
        worse_0_3m=_mean(size > 0.3),
        worse_1m=_mean(size > 1.0),
    )


def risk_coverage(size: Array, sigma: Array) -> Array:
    """Compute the mean error of the k predictions with the smallest sigma, for k = 1..N.

    Predictions with equal sigma have no order, so each counts with the mean of their errors.

    Args:
        size: Absolute errors (N,).
        sigma: Uncertainty that sorts the errors (N,).

    Returns:
        The means (N,), in the unit of `size`.

    Example:
        >>> risk_coverage(np.array([1.0, 2.0, 6.0]), np.array([0.3, 0.1, 0.2]))
        array([2., 4., 3.])
    """
    _, group, count = np.unique(sigma, return_inverse=True, return_counts=True)
    mean = np.bincount(group, size) / count
    return np.asarray(np.cumsum(np.repeat(mean, count)) / _ranks(size))


def _return_errors(truth: Array, predicted: Array) -> ReturnErrors:
    known = predicted > 0
    error = predicted[known].astype(float) - truth[known]
    return ReturnErrors(**vars(errors(truth[known], error)), returns=len(truth), coverage=_mean(known))


def _uncertainty(truth: Array, error: Array, sigma: Array) -> dict[str, Any]:
    """Calibration and ranking by sigma; None for methods without sigma."""
    if not np.isfinite(sigma).any():
        return {"ause_mm": None, "calibration": None, "at_80": None, "risk_coverage": None}
    size = np.abs(error)
    risk, oracle = risk_coverage(size, sigma), np.cumsum(np.sort(size)) / _ranks(size)
    surest = np.argsort(sigma, kind="stable")[: round(AT_COVERAGE * len(sigma))]
    at = np.maximum(np.ceil(CURVE * len(size)).astype(int), 1) - 1
    return {
        "ause_mm": 1000 * float(np.mean(risk - oracle)),
        "calibration": _mean(size <= sigma),
        "at_80": errors(truth[surest], error[surest]),
        "risk_coverage": RiskCoverage(*(tuple(each.tolist()) for each in (CURVE, 1000 * risk[at], 1000 * oracle[at]))),
    }


def _ranks(values: Array) -> Array:
    return np.arange(1, len(values) + 1)


def _mean(values: Array) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _root_mean_square(values: Array) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else None
