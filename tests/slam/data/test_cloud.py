"""Points of a cloud by mask, index and slice."""

import numpy as np
import pytest

from slam.data.cloud import PointCloud

CLOUD = PointCloud(np.arange(12, dtype=np.float32).reshape(4, 3), np.arange(4, dtype=np.float32))


@pytest.mark.parametrize(
    "index", [np.array([False, True, False, True]), np.array([1, 3]), slice(1, None, 2)], ids=["mask", "index", "slice"]
)
def test_points_are_selected_with_their_fields(index: np.ndarray | slice) -> None:
    selected = CLOUD.select(index)
    assert selected.xyz.tolist() == [[3, 4, 5], [9, 10, 11]]
    assert selected.intensity.tolist() == [1, 3]


@pytest.mark.parametrize("length", [3, 5])
def test_a_mask_of_another_length_is_an_error(length: int) -> None:
    with pytest.raises(IndexError, match="4 points"):
        CLOUD.select(np.zeros(length, bool))
