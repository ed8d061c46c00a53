"""Figures of a study, and their means over images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data.cloud import Array

#: [what was tried][how much of it] -> figures; NaN where there was nothing to measure
Figures = dict[str, dict[str, dict[str, float]]]


def mean_figures(images: Sequence[Figures]) -> Figures:
    """The mean of every figure over the images that have it, NaN where none has. All have the same keys."""
    return {
        tried: {
            amount: {name: mean([image[tried][amount][name] for image in images]) for name in figures}
            for amount, figures in amounts.items()
        }
        for tried, amounts in images[0].items()
    }


def mean(values: Array | Sequence[float]) -> float:
    """Without what is not a number; NaN where nothing is left."""
    found = np.asarray(values, float)
    found = found[np.isfinite(found)]
    return float(found.mean()) if found.size else float("nan")
