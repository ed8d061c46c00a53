"""The registry: every name makes something that predicts."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest

from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.methods.registry import METHODS, make_methods, runnable
from slam.data.errors import InputError


@pytest.mark.parametrize("name", METHODS.names())
def test_every_method_can_be_created(name: str, sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    prediction = make_methods([name])[name](sparse(), grid)
    for values in (prediction.ranges, prediction.sigma, prediction.trusted):
        assert values.shape == grid.shape
    known = prediction.ranges > 0
    assert np.isfinite(prediction.ranges).all()
    assert (prediction.sigma[known] > 0).all()
    assert not prediction.trusted[~known].any()


def test_an_unknown_name_is_an_error_with_the_most_similar_one() -> None:
    with pytest.raises(InputError, match="did you mean 'ray-segment'"):
        make_methods(["ray-segments"])


def test_a_package_can_add_a_method(installed: Callable[[str, str, dict[str, str]], object]) -> None:
    source = "from enrichment.interpolation.ray_segment import RaySegment\nclass Mine(RaySegment): ...\n"
    installed("my-enricher", "[lidarlift.methods]\nmine = my_enricher:Mine\n", {"my_enricher.py": source})
    assert METHODS.names()[-1] == runnable()[-1] == "mine"
    assert type(make_methods(["ray-segment", "mine"])["mine"]).__name__ == "Mine"


def test_listing_names_imports_no_computing_modules() -> None:
    program = (
        "import sys; from enrichment.methods.registry import METHODS; METHODS.require(*METHODS.names());"
        "print(*{'numpy', 'numba', 'cv2', 'onnxruntime', 'enrichment.geometry'} & set(sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout == b"\n"
