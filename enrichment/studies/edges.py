"""Image edges as predictors of depth discontinuities: precision and recall over the threshold of the detector.

The comparison of Yue et al. (their Fig. 3), with figures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from enrichment.studies.depth_image import DepthImage, discontinuities
from enrichment.studies.figures import Figures, mean
from slam.data.cloud import Array

THRESHOLDS = (10, 20, 40, 60, 90, 130, 180, 250, 350)  # of Sobel's filter: eight times the grey levels per pixel
BLUR = 1.0  # pixels, standard deviation before the gradient
TOLERANCE = 3  # pixels: returns are up to six rows and three columns apart

PROTOCOL = {
    "canny": "Canny edges; the given threshold is the upper one, the lower one is half of it",
    "gradient": "pixels whose gradient magnitude (Sobel) is above the threshold",
    "precision": "share of the edge pixels within 3 pixels of a depth discontinuity",
    "recall": "share of the discontinuity pixels within 3 pixels of an edge",
    "chance": "the same for edges or discontinuities that are spread uniformly over the image, as a baseline",
    "discontinuity": "depth differs by more than 10 % across it, also when both sides are extrapolated as planes",
    "where": "pixels among the LiDAR's returns; means over images",
}


@dataclass(frozen=True)
class EdgeFigures:
    """Agreement of the edges of an image with its depth discontinuities; shares, 0..1, see `PROTOCOL`.

    Attributes:
        edges: Share of the pixels that are edges.
        precision: Share of the edges that are near a discontinuity.
        precision_by_chance: Precision of uniformly spread edges.
        recall: Share of the discontinuities that are near an edge.
        recall_by_chance: Recall of uniformly spread discontinuities.
    """

    edges: float
    precision: float
    precision_by_chance: float
    recall: float
    recall_by_chance: float


def canny(grey: Array, threshold: float) -> Array:
    """Detect Canny edges (H, W) bool in a grey image (H, W) uint8."""
    import cv2

    return np.asarray(cv2.Canny(_blurred(grey), threshold / 2, threshold, L2gradient=True)) > 0


def gradient(grey: Array, threshold: float) -> Array:
    """Select pixels (H, W) bool of a grey image (H, W) uint8 with a gradient above the threshold."""
    import cv2

    across, down = (cv2.Sobel(_blurred(grey), cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    return np.asarray(np.hypot(across, down)) > threshold


DETECTORS: dict[str, Callable[[Array, float], Array]] = {"canny": canny, "gradient": gradient}


def edges(image: DepthImage) -> Figures[EdgeFigures]:
    """Compute the figures [detector][threshold] of one image."""
    grey, lines = grey_of(image), discontinuities(image.depth).any(axis=0) & image.known
    return {
        name: {threshold: _figures(detect(grey, threshold), lines, image.known) for threshold in THRESHOLDS}
        for name, detect in DETECTORS.items()
    }


def grey_of(image: DepthImage) -> Array:
    """Return the grey image (H, W) uint8."""
    import cv2

    return np.asarray(cv2.cvtColor(np.ascontiguousarray(image.image), cv2.COLOR_RGB2GRAY))


def near(lines: Array) -> Array:
    """Select the pixels (H, W) bool within TOLERANCE of lines (H, W) bool."""
    if not lines.any():
        return np.zeros_like(lines)
    return np.asarray(distance_transform_edt(~lines) <= TOLERANCE)


def _figures(found: Array, lines: Array, known: Array) -> EdgeFigures:
    near_edge, near_line = near(found), near(lines)
    return EdgeFigures(
        edges=mean(found[known]),
        precision=mean(near_line[found & known]),
        precision_by_chance=mean(near_line[known]),
        recall=mean(near_edge[lines]),
        recall_by_chance=mean(near_edge[known]),
    )


def _blurred(grey: Array) -> Array:
    import cv2

    return np.asarray(cv2.GaussianBlur(grey, (0, 0), BLUR))
