"""Figures of a study, and their means over images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from slam.data.cloud import Array

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

F = TypeVar("F", bound="DataclassInstance")

#: [variant][amount] -> figures, all numbers; NaN if there was nothing to measure
Figures = Mapping[str, Mapping[float, F]]


def mean_figures(images: Sequence[Figures[F]]) -> Figures[F]:
    """Average each figure over the images that have it; NaN if none has.

    Args:
        images: Figures of each image, at least one; all have the same keys.

    Returns:
        Figures with the same keys.
    """
    return {
        tried: {amount: _mean([image[tried][amount] for image in images]) for amount in amounts}
        for tried, amounts in images[0].items()
    }


def mean(values: Array | Sequence[float]) -> float:
    """Return the mean of the finite values; NaN without any."""
    found = np.asarray(values, float)
    found = found[np.isfinite(found)]
    return float(found.mean()) if found.size else float("nan")


def _mean(figures: Sequence[F]) -> F:
    kind = type(figures[0])
    return kind(*(mean([getattr(each, field.name) for each in figures]) for field in fields(kind)))
