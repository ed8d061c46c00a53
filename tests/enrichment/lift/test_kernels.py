"""Kernels of Lift's input that stand on their own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enrichment.lift.kernels import weighted_median


@pytest.mark.parametrize(
    ("values", "weights", "median", "spread"),
    [((3, 1, 2), (1, 1, 1), 2, 2 / 3), ((3, 1, 2), (3, 1, 1), 3, 0.6), ((5, 4, 9), (0, 1, 0.2), 4, 1 / 1.2)],
)
def test_weighted_medians_of_small_examples(
    values: tuple[float, ...], weights: tuple[float, ...], median: float, spread: float
) -> None:
    more = np.array([*values, 77], np.float32), np.array([*weights, 99], np.float32)  # beyond the count
    assert weighted_median(*more, 3) == pytest.approx((median, spread))


@given(st.lists(st.tuples(st.floats(0.1, 100), st.floats(0.01, 1)), min_size=1, max_size=9))
def test_weighted_medians_split_the_weight(pairs: list[tuple[float, float]]) -> None:
    values, weights = np.array(pairs, np.float32).T.copy()
    median, _ = weighted_median(values, weights, len(values))
    assert weights[values <= median].sum() >= weights.sum() / 2 * (1 - 1e-5)
    assert weights[values >= median].sum() >= weights.sum() / 2 * (1 - 1e-5)
