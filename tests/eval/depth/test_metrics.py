"""Depth figures against literal errors, and uncertainty against what it must be at its best and at its worst."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval.depth import metrics
from eval.depth.metrics import Predictions, range_figures, risk_coverage

TRUTH = np.array([5.0, 10.0, 20.0, 50.0, 60.0])
PREDICTED = np.array([5.2, 9.5, 22.0, 50.0, 0.0])
SIGMA = np.array([0.1, 0.5, 3.0, 0.2, np.inf])
TRUSTED = np.array([True, True, False, False, True])

values = st.lists(st.tuples(st.floats(0, 100), st.sampled_from([0.1, 0.2, 0.5, 1.0, np.inf])), min_size=1, max_size=50)


def test_errors_cover_returns_with_a_prediction():
    figures = range_figures(TRUTH, PREDICTED, SIGMA, TRUSTED)
    assert figures.returns == 5
    assert figures.coverage == 0.8
    assert figures.mae_mm == pytest.approx((200 + 500 + 2000 + 0) / 4)
    assert figures.rmse_mm == pytest.approx(1000 * np.sqrt((0.04 + 0.25 + 4) / 4))
    assert figures.median_mm == pytest.approx(350)
    assert figures.worse_0_3m == 0.5
    assert figures.worse_1m == 0.25
    inverse = np.array([200 - 1000 / 5.2, 1000 / 9.5 - 100, 50 - 1000 / 22, 0])
    assert figures.imae == pytest.approx(inverse.mean())
    assert figures.irmse == pytest.approx(np.sqrt((inverse**2).mean()))
    assert figures.calibration == 0.75


def test_bands_split_returns_by_true_range():
    bands = range_figures(TRUTH, PREDICTED, SIGMA, TRUSTED).bands
    assert {name: band.returns for name, band in bands.items()} == {"0-10": 1, "10-20": 1, "20-40": 1, "40-80": 2}
    assert bands["10-20"].mae_mm == pytest.approx(500)
    assert bands["40-80"].coverage == 0.5


def test_trusted_figures_cover_trusted_predictions():
    trusted = range_figures(TRUTH, PREDICTED, SIGMA, TRUSTED).trusted
    assert trusted.coverage == 0.4
    assert trusted.mae_mm == pytest.approx(350)


def test_at_80_covers_the_smallest_sigmas():
    error = np.array([0.1, 0.2, 0.3, 0.4, 5.0])
    figures = range_figures(TRUTH, TRUTH + error, np.array([0.5, 0.1, 0.3, 0.2, 9.0]), np.ones(5, bool))
    assert figures.at_80.mae_mm == pytest.approx(250)


def test_ause_of_a_small_example():
    """Errors 1, 3 m, the larger one held for the surer: curves 3, 2 and 1, 2."""
    truth = np.array([10.0, 10.0])
    figures = range_figures(truth, np.array([11.0, 13.0]), np.array([0.2, 0.1]), np.ones(2, bool))
    assert figures.ause_mm == pytest.approx(1000)
    assert figures.risk_coverage.mae_mm[-1] == pytest.approx(2000)
    assert figures.risk_coverage.oracle_mm[0] == pytest.approx(1000)


def test_ause_is_zero_if_sigma_ranks_like_the_error():
    error = np.array([0.4, 0.1, 2.0, 0.7, 0.2])
    assert range_figures(TRUTH, TRUTH + error, 3 * error, np.ones(5, bool)).ause_mm == pytest.approx(0, abs=1e-9)


@given(values)
def test_risk_ends_at_the_mean_and_is_at_least_the_oracle(pairs):
    size, sigma = np.array(pairs).T
    risk = risk_coverage(size, sigma)
    oracle = np.cumsum(np.sort(size)) / np.arange(1, len(size) + 1)
    assert risk[-1] == pytest.approx(size.mean())
    assert (risk >= oracle - 1e-9).all()


@given(values, st.randoms(use_true_random=False))
def test_figures_do_not_depend_on_the_order_of_returns(pairs, random):
    shuffled = random.sample(pairs, len(pairs))
    np.testing.assert_allclose(*(risk_coverage(*np.array(order).T) for order in (pairs, shuffled)), atol=1e-9)


def test_constant_sigma_has_a_flat_risk():
    assert risk_coverage(np.array([1.0, 2.0, 6.0]), np.ones(3)) == pytest.approx([3, 3, 3])


def test_without_sigma_uncertainty_figures_are_none():
    figures = range_figures(TRUTH, PREDICTED, np.full(5, np.inf), TRUSTED)
    assert figures.mae_mm is not None
    assert [getattr(figures, name) for name in ("ause_mm", "calibration", "at_80", "risk_coverage")] == [None] * 4


@pytest.mark.parametrize("count", [0, 5])
def test_without_predictions_figures_are_none(count):
    nothing = np.zeros(count)
    figures = range_figures(TRUTH[:count], nothing, nothing + np.inf, nothing > 0)
    assert figures.coverage == (0 if count else None)
    assert figures.mae_mm is None
    assert figures.bands["0-10"].mae_mm is None


def test_predictions_of_frames_are_pooled():
    answers, answer = Predictions(2), (PREDICTED, SIGMA, TRUSTED)
    for part in (slice(0, 2), slice(2, 5)):
        answers.add(TRUTH[part], {"method": tuple(values[part] for values in answer)})
    expected = range_figures(TRUTH.astype(np.float32), *answer)
    assert answers.figures()["method"] == expected


def test_only_selected_returns_count():
    answers = Predictions(1)
    answers.add(TRUTH, {"method": (PREDICTED, SIGMA, TRUSTED)}, np.array([False, True, True, False, False]))
    figures = answers.figures()["method"]
    assert figures.returns == 2
    assert figures.mae_mm == pytest.approx(1250)


def test_predictions_are_subsampled_to_the_maximum(monkeypatch):
    monkeypatch.setattr(metrics, "MAX_RETURNS", 200)
    answers, truth = Predictions(2), np.linspace(1, 70, 1000)
    for _ in range(2):
        answers.add(truth, {"method": (truth + 0.5, truth, truth > 0)})
    figures = answers.figures()["method"]
    assert figures.returns == 200
    assert figures.mae_mm == pytest.approx(500, rel=1e-3)
    assert all(band.returns > 0 for band in figures.bands.values())
