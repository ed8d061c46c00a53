"""Share of a depth image that few coefficients preserve: all of a smooth image, less of others."""

from __future__ import annotations

import numpy as np
import pytest

from enrichment.studies.depth_image import DepthImage
from enrichment.studies.figures import mean_figures
from enrichment.studies.sparsity import FRACTIONS, SELECTIONS, reconstruct, sparsity
from slam.data.cloud import Array

ROW, COLUMN = np.mgrid[0:64, 0:96]


def depth_image(depth: Array) -> DepthImage:
    return DepthImage(depth.astype(float), np.ones(depth.shape, bool), np.zeros((*depth.shape, 3), np.uint8), 0)


@pytest.mark.parametrize("selection", SELECTIONS)
def test_constant_depth_is_preserved_by_any_fraction(selection: str) -> None:
    for fraction in (*FRACTIONS, 1e-9):
        np.testing.assert_allclose(reconstruct(np.full((64, 96), 12.5), fraction, selection), 12.5)


@pytest.mark.parametrize("selection", SELECTIONS)
def test_one_frequency_needs_one_coefficient(selection: str) -> None:
    """Cosine number 3 of 96 columns; the largest two coefficients are the mean and it."""
    wave = 20 + 5 * np.cos(np.pi * 3 * (COLUMN + 0.5) / 96)
    np.testing.assert_allclose(reconstruct(wave, 1 / 64, selection), wave, atol=1e-9)


@pytest.mark.parametrize("selection", SELECTIONS)
def test_errors_grow_with_fewer_coefficients(selection: str) -> None:
    rng = np.random.default_rng(3)
    depth = 20 + np.where(COLUMN > 50, 15.0, 0) + rng.normal(0, 1, ROW.shape)
    errors = [figures.rmse_m for figures in sparsity(depth_image(depth))[selection].values()]
    assert errors[0] == pytest.approx(0, abs=1e-9)
    assert all(np.diff(errors) > 0)


def test_largest_coefficients_are_at_least_as_good_as_lowest() -> None:
    """Parseval: what is left out is the error, and the largest leave out the least; the counts are about equal."""
    figures = sparsity(depth_image(np.where(COLUMN > 50, 30.0, 10.0) + ROW / 20))
    for fraction in FRACTIONS[1:]:
        kept = round(np.sqrt(fraction) * 64) * round(np.sqrt(fraction) * 96) / (64 * 96)
        assert kept <= 1.1 * fraction
        assert figures["largest"][fraction].rmse_m <= figures["lowest"][fraction].rmse_m + 1e-9


def test_an_edge_is_lost_with_its_frequencies() -> None:
    bars = np.where(COLUMN // 12 % 2, 30.0, 10.0)
    lowest = sparsity(depth_image(bars))["lowest"]
    assert lowest[1.0].preserved == 1
    assert lowest[1.0].height_kept == pytest.approx(1)
    assert lowest[0.015625].height_kept < 0.9
    assert lowest[0.015625].mae_at_jumps_m > 2 * lowest[0.015625].mae_elsewhere_m


def test_without_discontinuities_their_figures_are_nan() -> None:
    plain, stepped = (sparsity(depth_image(depth)) for depth in (np.full((64, 96), 10.0), 10.0 + 20 * (COLUMN > 50)))
    assert np.isnan(plain["largest"][0.5].preserved)
    both = mean_figures([plain, stepped])["lowest"][0.5]
    assert both.preserved == stepped["lowest"][0.5].preserved
    assert both.rmse_m == pytest.approx(stepped["lowest"][0.5].rmse_m / 2)
