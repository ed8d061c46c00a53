"""Sparsity of depth images in frequency: reconstruction from few coefficients of the cosine transform.

The sparsity study of Yue et al. (their Fig. 2), with figures, above all on the preservation of depth discontinuities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.fft import dctn, idctn
from scipy.ndimage import distance_transform_edt

from enrichment.studies.depth_image import DepthImage, discontinuities, steps
from enrichment.studies.figures import Figures, mean
from slam.data.cloud import Array

FRACTIONS = tuple(2.0**-k for k in range(7))
AT_JUMP = 3  # pixels: an error within this distance of a discontinuity counts as at it
PRESERVED = 0.5  # minimum share of its height that a preserved discontinuity keeps

PROTOCOL = {
    "transform": "two-dimensional cosine transform (DCT-II, orthonormal) of depth in metres",
    "largest": "the coefficients of largest magnitude are kept",
    "lowest": "the block of lowest frequencies is kept, with equal shares of rows and columns",
    "errors": "mean over images, in metres; at jumps: within 3 pixels of a depth discontinuity",
    "discontinuity": "depth differs by more than 10 % across it, also when both sides are extrapolated as planes",
    "height kept": "sum of the reconstructed depth differences across discontinuities / sum of the original ones",
    "preserved": "share of the pixels on discontinuities that keep at least half of their height",
}


@dataclass(frozen=True)
class SparsityFigures:
    """Errors of a reconstructed depth image, see `PROTOCOL`.

    Attributes:
        mae_m: Mean absolute error [m].
        rmse_m: Root mean square error [m].
        mae_at_jumps_m: Mean absolute error at depth discontinuities [m].
        mae_elsewhere_m: Mean absolute error elsewhere [m].
        height_kept: Share of the height of discontinuities that is kept, 1 for all.
        preserved: Share of the discontinuity pixels that keep at least half of their height, 0..1.
    """

    mae_m: float
    rmse_m: float
    mae_at_jumps_m: float
    mae_elsewhere_m: float
    height_kept: float
    preserved: float


def largest(coefficients: Array, fraction: float) -> Array:
    """Keep the share `fraction` of coefficients (H, W) with the largest magnitude; set the others to 0."""
    size = np.abs(coefficients)
    count = max(round(fraction * size.size), 1)
    return np.where(size >= np.partition(size, -count, axis=None)[-count], coefficients, 0.0)


def lowest(coefficients: Array, fraction: float) -> Array:
    """Keep the block of lowest frequencies, about the share `fraction` of coefficients (H, W); set the others to 0."""
    rows, columns = (max(round(np.sqrt(fraction) * size), 1) for size in coefficients.shape)
    kept = np.zeros_like(coefficients)
    kept[:rows, :columns] = coefficients[:rows, :columns]
    return kept


SELECTIONS: dict[str, Callable[[Array, float], Array]] = {"largest": largest, "lowest": lowest}


def reconstruct(depth: Array, fraction: float, selection: str) -> Array:
    """Reconstruct a depth image (H, W) [m] from the share `fraction` of its coefficients."""
    return np.asarray(idctn(SELECTIONS[selection](dctn(depth, norm="ortho"), fraction), norm="ortho"))


def sparsity(image: DepthImage) -> Figures[SparsityFigures]:
    """Compute the figures [selection][fraction] of one depth image."""
    lines = discontinuities(image.depth) & image.known
    at_jump = distance_transform_edt(~lines.any(axis=0)) <= AT_JUMP
    return {
        selection: {
            fraction: _figures(image.depth, reconstruct(image.depth, fraction, selection), lines, at_jump)
            for fraction in FRACTIONS
        }
        for selection in SELECTIONS
    }


def _figures(depth: Array, reconstructed: Array, lines: Array, at_jump: Array) -> SparsityFigures:
    error = np.abs(reconstructed - depth)
    before = steps(depth)[lines]
    after = steps(reconstructed)[lines] * np.sign(before)  # a step of the opposite sign counts as negative
    before = np.abs(before)
    return SparsityFigures(
        mae_m=mean(error),
        rmse_m=float(np.sqrt(mean(error**2))),
        mae_at_jumps_m=mean(error[at_jump]),
        mae_elsewhere_m=mean(error[~at_jump]),
        height_kept=mean(after) / mean(before),
        preserved=mean(after >= PRESERVED * before),
    )
