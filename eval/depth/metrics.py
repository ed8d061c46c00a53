"""Predicted ranges against measured ones: how wrong, how many, and whether their sigma tells the good from the bad."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from slam.data.cloud import Array

BANDS = ((0, 10), (10, 20), (20, 40), (40, 80))  # m of true range
SURE = 0.8  # share of the predictions, those with the smallest sigma, that `at_80` is about
CURVE = np.arange(1, 21) / 20  # shares at which the risk-coverage curve is written down
MOST_RETURNS = 4_000_000  # that `Answers` keeps

#: What the figures of `range_figures` are, for whoever reads them.
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


@dataclass(frozen=True)
class Errors:
    """How wrong predicted ranges or depths are; every figure is None where nothing was predicted.

    Attributes:
        mae_mm: Mean absolute error [mm].
        rmse_mm: Root of the mean square error [mm].
        imae: Mean absolute error of the inverse [1/km].
        irmse: Root of the mean square error of the inverse [1/km].
        median_mm: Median absolute error [mm].
        worse_0_3m: Share of the predictions that are wrong by more than 0.3 m, 0..1.
        worse_1m: Share of the predictions that are wrong by more than 1 m, 0..1.
    """

    mae_mm: float | None
    rmse_mm: float | None
    imae: float | None
    irmse: float | None
    median_mm: float | None
    worse_0_3m: float | None
    worse_1m: float | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        names = ("mae_mm", "rmse_mm", "imae", "irmse", "median_mm")
        shares = {"worse_0.3m": self.worse_0_3m, "worse_1m": self.worse_1m}
        return {name: getattr(self, name) for name in names} | shares


@dataclass(frozen=True)
class ReturnErrors(Errors):
    """The same over the held-out returns that a prediction exists for.

    Attributes:
        returns: How many returns were held out.
        coverage: Share of them that a prediction exists for, 0..1; None where there were none.
    """

    returns: int
    coverage: float | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"returns": self.returns, "coverage": self.coverage, **super().as_dict()}


@dataclass(frozen=True)
class RiskCoverage:
    """The error when only the surest predictions are taken, at the shares `CURVE` of them.

    Attributes:
        coverage: The shares, 0..1.
        mae_mm: Mean absolute error of so large a share, smallest sigma first [mm].
        oracle_mm: The same with the smallest error first, which no sigma can beat [mm].
    """

    coverage: tuple[float, ...]
    mae_mm: tuple[float, ...]
    oracle_mm: tuple[float, ...]


@dataclass(frozen=True)
class RangeFigures(ReturnErrors):
    """All figures of one method over held-out returns, see `PROTOCOL`; what needs a sigma is None without.

    Attributes:
        trusted: Of the predictions that the method itself holds worth registering.
        ause_mm: Area under the sparsification error curve [mm].
        calibration: Share of the predictions with |error| <= sigma, 0..1.
        at_80: Of the 80 % of the predictions with the smallest sigma.
        risk_coverage: The error over the share of the predictions, surest first.
        bands: By true range, "0-10" to "40-80" m.
    """

    trusted: ReturnErrors
    ause_mm: float | None
    calibration: float | None
    at_80: Errors | None
    risk_coverage: RiskCoverage | None
    bands: Mapping[str, ReturnErrors]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            **super().as_dict(),
            "trusted": self.trusted.as_dict(),
            "ause_mm": self.ause_mm,
            "calibration": self.calibration,
            "at_80": self.at_80 and self.at_80.as_dict(),
            "risk_coverage": self.risk_coverage and asdict(self.risk_coverage),
            "bands": {name: errors.as_dict() for name, errors in self.bands.items()},
        }


class Answers:
    """Held-out returns of a drive, and what methods said of them; `figures` has those of each method.

    Of more returns than `MOST_RETURNS` each frame keeps its share, evenly spread over its rings.

    Args:
        frames: How many frames will be added.
    """

    def __init__(self, frames: int) -> None:
        self._most = max(MOST_RETURNS // frames, 1)
        self._truth: list[Array] = []
        self._answers: dict[str, list[tuple[Array, ...]]] = {}

    def add(self, truth: Array, answers: Mapping[str, tuple[Array, ...]], which: Array | None = None) -> None:
        """Add a frame's returns.

        Args:
            truth: True ranges (M,) [m].
            answers: Of each method, the same each time, predicted, sigma and trusted (M,) as in `range_figures`.
            which: (M,) bool, which returns count; by default all.
        """
        counted = np.arange(len(truth)) if which is None else np.flatnonzero(which)
        thinned = counted[:: max(-(-len(counted) // self._most), 1)]
        self._truth.append(truth[thinned].astype(np.float32))
        for name, parts in answers.items():
            self._answers.setdefault(name, []).append(tuple(part[thinned] for part in parts))

    def figures(self) -> dict[str, RangeFigures]:
        """By method; none where nothing was added."""
        return {
            name: range_figures(
                np.concatenate(self._truth), *(np.concatenate(part) for part in zip(*parts, strict=True))
            )
            for name, parts in self._answers.items()
        }


def range_figures(truth: Array, predicted: Array, sigma: Array, trusted: Array) -> RangeFigures:
    """All figures of one method's ranges along rays whose returns are known; `PROTOCOL` has their definitions.

    Args:
        truth: True ranges (N,) [m].
        predicted: Ranges (N,) [m], 0 where there is no prediction.
        sigma: Half the width of the central 68 % interval of the error (N,) [m], infinite where unknown.
        trusted: (N,) bool, whether the method holds its prediction worth registering.

    Returns:
        The figures; what cannot be computed is None.

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
    """How wrong predictions are.

    Args:
        truth: True ranges or depths (N,) [m].
        error: Predicted minus true (N,) [m].

    Returns:
        The figures, None each where N = 0.

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
    """The mean error of the k predictions of smallest sigma, for k = 1..N.

    Among equal sigmas the order says nothing, so each counts with their mean.

    Args:
        size: Absolute errors (N,).
        sigma: What sorts them (N,).

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
        "risk_coverage": RiskCoverage(*(tuple(each.tolist()) for each in (CURVE, 1000 * risk[at], 1000 * oracle[at]))),
    }


def _ranks(values: Array) -> Array:
    return np.arange(1, len(values) + 1)


def _mean(values: Array) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _root_mean_square(values: Array) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else None
