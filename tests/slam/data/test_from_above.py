"""Order in which points are drawn from above."""

from __future__ import annotations

import numpy as np

from slam.data.from_above import highest_last


def test_the_highest_points_are_last() -> None:
    assert highest_last(np.array([0.5, -1.0, 2.0, -1.0])).tolist() == [1, 3, 0, 2]
    assert highest_last(np.zeros(0)).tolist() == []
