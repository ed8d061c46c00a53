"""Depth in cells."""

from __future__ import annotations

import numpy as np
import pytest

from enrichment.training.pooling import cells_of, in_front, nearest_depth, pooled


def test_pixels_are_assigned_to_cells() -> None:
    pixels = np.array([[0, 0], [1, 0], [1.4, 1], [1.6, 2], [5, 3]])
    assert cells_of(pixels, 0.5).tolist() == [[0, 0], [0, 0], [0, 0], [1, 1], [2, 1]]
    assert cells_of(pixels, 1.0).tolist() == [[0, 0], [1, 0], [1, 1], [2, 2], [5, 3]]


def test_nearest_depth_is_the_minimum() -> None:
    cells = np.array([[0, 0], [0, 0], [1, 0], [2, 0], [-1, 0]])
    assert nearest_depth(cells, np.array([4.0, 3, 9, 7, 1]), (1, 2)).tolist() == [[3, 9]]


def test_pooling_is_exact_on_planes_and_takes_the_nearer_side_of_edges() -> None:
    cells = np.array([[0, 0], [0, 0], [1, 0], [1, 0]])
    image = pooled(cells, np.array([10.0, 10.5, 10, 30]), (1, 3))
    assert image[0] == pytest.approx([2 / (1 / 10 + 1 / 10.5), 10, 0], rel=1e-6)


def test_points_behind_adjacent_cells_are_occluded() -> None:
    cells = np.array([[1, 1], [2, 1], [5, 1], [2, 2], [9, 9]])
    assert in_front(cells, np.array([5.0, 20, 20, 5.9, 1]), (3, 6)).tolist() == [True, False, True, True, False]
