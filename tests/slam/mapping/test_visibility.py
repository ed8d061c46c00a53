"""Range images: which bin a beam falls into."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data.cloud import PointCloud
from slam.mapping import kernels
from slam.mapping.visibility import SPHERE_COLUMNS, SPHERE_ROWS, RangeImage

BIN = np.deg2rad(0.5)


@pytest.mark.parametrize("beyond", [0.5, 1e-3, 2e-6])
def test_a_beam_falls_into_its_own_bin_also_near_the_edge(beyond: float) -> None:
    """A share of a bin before and after each edge, around the horizon; nearer to it than a fast angle can tell."""
    edges = np.arange(-355, 356)
    for side in (-beyond, beyond):
        azimuth = (edges + side) * BIN
        xyz = 10.0 * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.full(len(edges), 0.02)])
        image = kernels.range_image(xyz, np.ones(len(xyz), bool), SPHERE_ROWS, SPHERE_COLUMNS)
        expected = edges + SPHERE_COLUMNS // 2 - (side < 0)
        assert image.nonzero()[1].tolist() == expected.tolist()


@pytest.mark.parametrize("beyond", [0.5, 1e-3, 2e-6])
def test_the_row_follows_the_elevation(beyond: float) -> None:
    edges = np.arange(-170, 171)
    elevation = (edges + beyond) * BIN
    xyz = 10.0 * np.column_stack([np.cos(elevation), np.zeros(len(edges)), np.sin(elevation)])
    image = kernels.range_image(xyz, np.ones(len(xyz), bool), SPHERE_ROWS, SPHERE_COLUMNS)
    assert image.nonzero()[0].tolist() == sorted((SPHERE_ROWS // 2 - 1 - edges).tolist())


def test_the_nearest_measured_return_counts() -> None:
    xyz = np.array([[12, 0.01, 0.01], [7, 0.01, 0.01], [3, 0.01, 0.01], [0, 0, 0], [np.nan, 0, 0]])
    cloud = PointCloud(xyz, np.zeros(5), measured=np.array([True, True, False, True, True]))
    view = RangeImage.of(cloud)
    assert view.nearest[view.nearest > 0].tolist() == [700]
