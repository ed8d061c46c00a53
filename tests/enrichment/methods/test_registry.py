"""The registry: every name makes something that predicts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.methods.registry import METHODS, make_methods
from slam.data.errors import InputError


@pytest.mark.parametrize("name", METHODS)
def test_every_name_makes_a_method(name: str, sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    prediction = make_methods([name])[name](sparse(), grid)
    for values in (prediction.ranges, prediction.sigma, prediction.trusted):
        assert values.shape == grid.shape
    known = prediction.ranges > 0
    assert np.isfinite(prediction.ranges).all()
    assert (prediction.sigma[known] > 0).all()
    assert not prediction.trusted[~known].any()


def test_an_unknown_name_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(InputError, match="did you mean 'ray-segment'"):
        make_methods(["ray-segments"])
