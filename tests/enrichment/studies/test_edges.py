"""Edges of an image against the discontinuities of its depth, where both are known."""

from __future__ import annotations

import numpy as np
import pytest

from enrichment.studies.depth_image import DepthImage
from enrichment.studies.edges import DETECTORS, THRESHOLDS, edges
from slam.data.cloud import Array

ROW, COLUMN = np.mgrid[0:64, 0:96]


def picture(brightness: Array, depth: Array, known: Array | None = None) -> DepthImage:
    image = np.repeat(brightness.astype(np.uint8)[..., None], 3, axis=2)
    return DepthImage(depth.astype(float), np.ones(depth.shape, bool) if known is None else known, image, 0)


@pytest.mark.parametrize("detector", DETECTORS)
def test_an_edge_at_the_discontinuity_has_full_precision_and_recall(detector: str) -> None:
    figures = edges(picture(50 + 150 * (COLUMN >= 40), 10 + 10 * (COLUMN >= 40)))[detector]
    for threshold in THRESHOLDS[:-1]:
        assert figures[threshold].precision == 1
        assert figures[threshold].recall == 1
        assert figures[threshold].recall_by_chance < 0.2


def test_an_edge_elsewhere_has_no_precision_and_recall() -> None:
    figures = edges(picture(50 + 150 * (COLUMN >= 20), 10 + 10 * (COLUMN >= 60)))["canny"][90]
    assert figures.precision == 0
    assert figures.recall == 0


def test_painted_edges_halve_precision_only() -> None:
    stripe = 150 * (COLUMN >= 40) * (COLUMN < 60)
    figures = edges(picture(50 + stripe, 10 + 10 * (COLUMN >= 40)))["canny"][90]
    assert figures.precision == pytest.approx(0.5, abs=0.02)
    assert figures.recall == 1


def test_recall_falls_as_the_threshold_rises() -> None:
    contrast = np.linspace(0, 250, 64)[:, None]
    found = edges(picture(np.where(COLUMN >= 40, contrast, 0), 10 + 10 * (COLUMN >= 40)))
    for detector in DETECTORS:
        recall = [figures.recall for figures in found[detector].values()]
        assert all(np.diff(recall) <= 0)
        assert recall[0] > recall[-1]


def test_unknown_pixels_do_not_count() -> None:
    known = COLUMN < 30
    figures = edges(picture(50 + 150 * (COLUMN >= 40), 10 + 10 * (COLUMN >= 60), known))["canny"][90]
    assert np.isnan(figures.precision)
    assert np.isnan(figures.recall)
    assert figures.edges == 0
