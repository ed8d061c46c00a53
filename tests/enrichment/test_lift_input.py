"""What Lift is given: the truth among the candidates, and nothing of the answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from enrichment.held_out import hold_out
from enrichment.lift_input import CANDIDATES, RAY_CHANNELS, RING_CHANNELS, LiftInput, lift_input
from enrichment.rays import RayGrid
from enrichment.sparse_scan import SparseScan
from slam.data.camera import project
from slam.data.cloud import Array, Calibration, Frame, PointCloud

LOOKING_AHEAD = np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.0], [1, 0, 0, 0.0], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[175.0, 0, 150], [0, 175.0, 42], [0, 0, 1]]), LOOKING_AHEAD)
IMAGE = np.full((93, 301, 3), 90, np.uint8)


def channel(given: LiftInput, name: str) -> Array:
    return np.asarray(given.rays[RAY_CHANNELS.index(name)])


def candidate(given: LiftInput, name: str) -> Array:
    return np.asarray(given.candidates[CANDIDATES.index(name)])


def same(one: LiftInput, other: LiftInput) -> bool:
    names = "rings", "upper", "rays", "candidates", "rows"
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def test_shapes(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    given = lift_input(sparse(), grid)
    assert given.rows.tolist() == [row for row in range(60) if row % 4]
    assert given.upper.tolist() == [row // 4 for row in given.rows]
    assert given.rings.shape == (len(RING_CHANNELS), 16, 2000)
    assert given.rays.shape == (len(RAY_CHANNELS), 45, 2000)
    assert given.candidates.shape == (len(CANDIDATES), 45, 2000)
    for values in (given.rings, given.rays, given.candidates):
        assert values.dtype == np.float32
        assert np.isfinite(values).all()


def test_moving_the_answers_does_not_move_the_input(dense: PointCloud, grid: RayGrid) -> None:
    """A network that could tell from its input where the held-out returns are would be useless without them."""
    moved = dense.xyz.copy()
    assert dense.ring is not None
    moved[dense.ring % 4 != 0] *= 1.37
    one, other = (
        hold_out(Frame(0, 0.0, cloud, CALIBRATION, lambda: IMAGE), grid) for cloud in (dense, dense.with_xyz(moved))
    )
    assert not np.allclose(one.ranges, other.ranges)
    assert same(lift_input(one.scan, grid), lift_input(other.scan, grid))


def test_on_a_plane_the_segment_and_both_extensions_are_right(
    sparse: Callable[..., SparseScan], dense: PointCloud, grid: RayGrid
) -> None:
    given = lift_input(sparse(), grid)
    truth = np.zeros(grid.shape)
    assert dense.ring is not None
    truth[dense.ring, grid.column_of(dense.xyz)] = np.hypot(dense.xyz[:, 0], dense.xyz[:, 1])
    truth = truth[given.rows]
    beside = (truth > 0) & (truth < 10) & (np.abs(grid.azimuth) > 2)  # ground alone
    for name in ("segment", "from above", "from below"):
        found = candidate(given, name)
        known = beside & (found > 0)
        assert known.sum() > 1000
        np.testing.assert_allclose(found[known], truth[known], rtol=1e-3)


def test_ranges_are_told_as_ratios(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    given = lift_input(sparse(), grid)
    known = channel(given, "known") > 0
    segment = candidate(given, "segment")
    np.testing.assert_allclose(10 * np.exp(channel(given, "range"))[known], segment[known], rtol=1e-4)
    for name in ("above", "below"):
        found = segment * np.exp(channel(given, name))
        np.testing.assert_allclose(found[known], candidate(given, name)[known], rtol=1e-4)
    for values in (given.rays, given.candidates):
        assert not values[:, ~known].any()


def test_the_image_tells_where_colours_change(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    """Dark above a row of the image, bright below: a ray whose pixel is dark is like the return above."""
    image = np.zeros((372, 1204, 3), np.uint8)
    image[240:] = 200
    calibration = replace(CALIBRATION, K=np.array([[700.0, 0, 600], [0, 700.0, 168], [0, 0, 1]]))
    scan = replace(sparse(), read_image=lambda: image, calibration=calibration)
    given = lift_input(scan, grid)
    assert not channel(lift_input(sparse(), grid), "seen").any()
    seen = channel(given, "seen") > 0
    row, column = np.nonzero(seen)
    rho = candidate(given, "segment")[seen]
    ranges = rho / np.cos(grid.sensor.elevation[given.rows[row]])
    pixels, _ = project(grid.points(ranges, given.rows[row], column), calibration)
    assert (np.abs(pixels - (601.5, 185.5)) <= (602.01, 186.01)).all()
    across = (channel(given, "change above") + channel(given, "change below") > 1.0)[seen]
    dark, bright = across & (pixels[:, 1] < 234), across & (pixels[:, 1] > 246)
    assert dark.sum() > 50
    assert bright.sum() > 50
    edge, above, below = (candidate(given, name)[seen] for name in ("edge", "above", "below"))
    np.testing.assert_allclose(edge[dark], above[dark], rtol=0.05)
    np.testing.assert_allclose(edge[bright], below[bright], rtol=0.05)
    assert (channel(given, "colour above")[seen][bright] > channel(given, "colour below")[seen][bright]).all()


def test_a_lens_is_taken_out_of_the_image(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    image = np.random.default_rng(0).integers(0, 255, IMAGE.shape).astype(np.uint8)
    bent = replace(CALIBRATION, distortion=(-0.3, 0.1, 0.0, 0.0))
    straight, other = (
        lift_input(replace(sparse(), read_image=lambda: image, calibration=one), grid) for one in (CALIBRATION, bent)
    )
    np.testing.assert_array_equal(straight.candidates[:5], other.candidates[:5])
    assert not np.array_equal(straight.rays, other.rays)


@pytest.mark.parametrize("phase", [1, 2, 3])
def test_any_first_ring(phase: int, sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    given = lift_input(sparse(phase), grid)
    assert (given.rows % 4 != phase).all()
    assert (channel(given, "known") > 0).mean() > 0.3
