"""How few frequencies a depth image needs: keep some coefficients of its cosine transform, and look what is left.

The sparsity study of Yue et al. (their Fig. 2), with figures: above all, whether depth discontinuities survive.
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
BESIDE = 3  # pixels: so near to a discontinuity an error counts as at it
PRESERVED = 0.5  # share of its height that a discontinuity must keep

PROTOCOL = {
    "transform": "two-dimensional cosine transform (DCT-II, orthonormal) of depth in metres",
    "largest": "the coefficients of largest magnitude are kept, wherever they are",
    "lowest": "the block of lowest frequencies is kept, the same share of rows as of columns",
    "errors": "mean over images, in metres; at jumps: within 3 pixels of a depth discontinuity",
    "discontinuity": "nearer by more than 10 % on one side than on the other, both sides continued as planes",
    "height kept": "sum of the reconstructed depth differences across discontinuities / sum of the original ones",
    "preserved": "share of the pixels on discontinuities that keep at least half of their height",
}


@dataclass(frozen=True)
class SparsityFigures:
    """What is left of a depth image, as `PROTOCOL` has it.

    Attributes:
        mae_m: Mean absolute error [m].
        rmse_m: Root of the mean square error [m].
        mae_at_jumps_m: Mean absolute error at depth discontinuities [m].
        mae_elsewhere_m: Mean absolute error elsewhere [m].
        height_kept: Share of the discontinuities' height that is left, 1 for all of it.
        preserved: Share of the discontinuities' pixels that keep at least half of their height, 0..1.
    """

    mae_m: float
    rmse_m: float
    mae_at_jumps_m: float
    mae_elsewhere_m: float
    height_kept: float
    preserved: float


def largest(coefficients: Array, fraction: float) -> Array:
    """The coefficients (H, W) of largest magnitude, so large a share of them; the others 0."""
    size = np.abs(coefficients)
    count = max(round(fraction * size.size), 1)
    return np.where(size >= np.partition(size, -count, axis=None)[-count], coefficients, 0.0)


def lowest(coefficients: Array, fraction: float) -> Array:
    """The block of lowest frequencies of coefficients (H, W), about so large a share of them; the others 0."""
    rows, columns = (max(round(np.sqrt(fraction) * size), 1) for size in coefficients.shape)
    kept = np.zeros_like(coefficients)
    kept[:rows, :columns] = coefficients[:rows, :columns]
    return kept


SELECTIONS: dict[str, Callable[[Array, float], Array]] = {"largest": largest, "lowest": lowest}


def reconstruct(depth: Array, fraction: float, selection: str) -> Array:
    """A depth image (H, W) [m] from the share `fraction` of its coefficients."""
    return np.asarray(idctn(SELECTIONS[selection](dctn(depth, norm="ortho"), fraction), norm="ortho"))


def sparsity(image: DepthImage) -> Figures[SparsityFigures]:
    """[selection][fraction] -> figures of one depth image."""
    lines = discontinuities(image.depth) & image.known
    beside = distance_transform_edt(~lines.any(axis=0)) <= BESIDE
    return {
        selection: {
            fraction: _figures(image.depth, reconstruct(image.depth, fraction, selection), lines, beside)
            for fraction in FRACTIONS
        }
        for selection in SELECTIONS
    }


def _figures(depth: Array, reconstructed: Array, lines: Array, beside: Array) -> SparsityFigures:
    error = np.abs(reconstructed - depth)
    before = steps(depth)[lines]
    after = steps(reconstructed)[lines] * np.sign(before)  # a step the wrong way counts against
    before = np.abs(before)
    return SparsityFigures(
        mae_m=mean(error),
        rmse_m=float(np.sqrt(mean(error**2))),
        mae_at_jumps_m=mean(error[beside]),
        mae_elsewhere_m=mean(error[~beside]),
        height_kept=mean(after) / mean(before),
        preserved=mean(after >= PRESERVED * before),
    )
