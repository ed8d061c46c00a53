"""Input of Lift: the truth is among the candidates, and nothing of the reference is in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from enrichment.geometry.held_out import hold_out
from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.lift.channels import CANDIDATES, RAYS, RINGS, Candidate, Ray
from enrichment.lift.features import LiftInput, lift_input
from slam.data.camera import project
from slam.data.cloud import Array, Calibration, Frame, PointCloud

LOOKING_AHEAD = np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.0], [1, 0, 0, 0.0], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[175.0, 0, 150], [0, 175.0, 42], [0, 0, 1]]), LOOKING_AHEAD)
IMAGE = np.full((93, 301, 3), 90, np.uint8)


def same(one: LiftInput, other: LiftInput) -> bool:
    names = "rings", "upper", "rays", "candidates", "rows"
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def test_the_input_has_the_documented_shapes(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    given = lift_input(sparse(), grid)
    assert given.rows.tolist() == [row for row in range(60) if row % 4]
    assert given.upper.tolist() == [row // 4 for row in given.rows]
    assert given.rings.shape == (RINGS, 16, 2000)
    assert given.rays.shape == (RAYS, 45, 2000)
    assert given.candidates.shape == (CANDIDATES, 45, 2000)
    for values in (given.rings, given.rays, given.candidates):
        assert values.dtype == np.float32
        assert np.isfinite(values).all()


def test_targets_do_not_leak_into_the_input(dense: PointCloud, grid: RayGrid) -> None:
    """A network that could tell from its input where the held-out returns are would be useless without them."""
    moved = dense.xyz.copy()
    assert dense.ring is not None
    moved[dense.ring % 4 != 0] *= 1.37
    one, other = (
        hold_out(Frame(0, 0.0, cloud, CALIBRATION, lambda: IMAGE), grid) for cloud in (dense, dense.with_xyz(moved))
    )
    assert not np.allclose(one.ranges, other.ranges)
    assert same(lift_input(one.scan, grid), lift_input(other.scan, grid))


def test_segment_and_extrapolations_are_exact_on_planes(
    sparse: Callable[..., SparseScan], dense: PointCloud, grid: RayGrid
) -> None:
    given = lift_input(sparse(), grid)
    truth = np.zeros(grid.shape)
    assert dense.ring is not None
    truth[dense.ring, grid.column_of(dense.xyz)] = np.hypot(dense.xyz[:, 0], dense.xyz[:, 1])
    truth = truth[given.rows]
    beside = (truth > 0) & (truth < 10) & (np.abs(grid.azimuth) > 2)  # ground alone
    for candidate in (Candidate.SEGMENT, Candidate.FROM_ABOVE, Candidate.FROM_BELOW):
        found = given.candidates[candidate]
        known = beside & (found > 0)
        assert known.sum() > 1000
        np.testing.assert_allclose(found[known], truth[known], rtol=1e-3)


def test_candidates_are_encoded_as_log_ratios(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    given = lift_input(sparse(), grid)
    known = given.rays[Ray.KNOWN] > 0
    segment = given.candidates[Candidate.SEGMENT]
    np.testing.assert_allclose(10 * np.exp(given.rays[Ray.RANGE])[known], segment[known], rtol=1e-4)
    for ray, candidate in ((Ray.ABOVE, Candidate.ABOVE), (Ray.BELOW, Candidate.BELOW)):
        found = segment * np.exp(given.rays[ray])
        np.testing.assert_allclose(found[known], given.candidates[candidate][known], rtol=1e-4)
    for values in (given.rays, given.candidates):
        assert not values[:, ~known].any()


def test_the_edge_candidate_follows_the_colour_change(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    """Dark above a row of the image, bright below: a ray whose pixel is dark is like the return above."""
    image = np.zeros((372, 1204, 3), np.uint8)
    image[240:] = 200
    calibration = replace(CALIBRATION, K=np.array([[700.0, 0, 600], [0, 700.0, 168], [0, 0, 1]]))
    scan = replace(sparse(), read_image=lambda: image, calibration=calibration)
    given = lift_input(scan, grid)
    assert not lift_input(sparse(), grid).rays[Ray.SEEN].any()
    seen = given.rays[Ray.SEEN] > 0
    row, column = np.nonzero(seen)
    rho = given.candidates[Candidate.SEGMENT][seen]
    ranges = rho / np.cos(grid.sensor.elevation[given.rows[row]])
    pixels, _ = project(grid.points(ranges, given.rows[row], column), calibration)
    assert (np.abs(pixels - (601.5, 185.5)) <= (602.01, 186.01)).all()
    across = (given.rays[Ray.CHANGE_ABOVE] + given.rays[Ray.CHANGE_BELOW] > 1.0)[seen]
    dark, bright = across & (pixels[:, 1] < 234), across & (pixels[:, 1] > 246)
    assert dark.sum() > 50
    assert bright.sum() > 50
    edge, above, below = (given.candidates[which][seen] for which in (Candidate.EDGE, Candidate.ABOVE, Candidate.BELOW))
    np.testing.assert_allclose(edge[dark], above[dark], rtol=0.05)
    np.testing.assert_allclose(edge[bright], below[bright], rtol=0.05)
    assert (given.rays[Ray.COLOUR_ABOVE][seen][bright] > given.rays[Ray.COLOUR_BELOW][seen][bright]).all()


def test_lens_distortion_is_removed(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    image = np.random.default_rng(0).integers(0, 255, IMAGE.shape).astype(np.uint8)
    bent = replace(CALIBRATION, distortion=(-0.3, 0.1, 0.0, 0.0))
    straight, other = (
        lift_input(replace(sparse(), read_image=lambda: image, calibration=one), grid) for one in (CALIBRATION, bent)
    )
    np.testing.assert_allclose(straight.candidates[:5], other.candidates[:5], rtol=1e-6)
    assert np.abs(straight.rays - other.rays).max() > 0.1


def lowered(dense: PointCloud, by: float) -> tuple[PointCloud, Array]:
    """The street as a LiDAR `by` metres lower saw it, and where that one was; its rings met other places."""
    T_now_then = np.eye(4)
    T_now_then[2, 3] = -by
    return dense.with_xyz(dense.xyz + np.array([0, 0, by])), T_now_then


def test_past_returns_on_a_ray_are_candidates(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    """A post that the rings missed now was seen before: the segment behind it is wrong, the past right."""
    scan, T_now_then = sparse(), np.eye(4)
    row, column = np.repeat(np.arange(64), 3), np.tile([1000, 1001, 1002], 64)
    post = grid.points(np.full(192, 9.0) / np.cos(grid.sensor.elevation[row]), row, column)
    saw = PointCloud(post, np.zeros(192), ring=row)
    given = lift_input(replace(scan, read_past=lambda: [(saw, T_now_then)]), grid)
    segment, past = given.candidates[Candidate.SEGMENT][:, 1001], given.candidates[Candidate.PAST][:, 1001]
    near = (segment > 8) & (segment < 11)
    assert near.sum() > 3
    np.testing.assert_allclose(past[near], 9.0, rtol=1e-3)
    found = segment[near] * np.exp(given.rays[Ray.PAST][:, 1001][near])
    np.testing.assert_allclose(found, 9.0, rtol=1e-3)
    assert not given.candidates[Candidate.PAST][:, :900].any()


def test_the_past_agrees_with_the_segments_of_a_static_scene(
    sparse: Callable[..., SparseScan], dense: PointCloud, grid: RayGrid
) -> None:
    before = [lowered(sparse().cloud, 0.0), lowered(dense, 0.05)]
    given = lift_input(replace(sparse(), read_past=lambda: before), grid)
    past, segment = given.candidates[Candidate.PAST], given.candidates[Candidate.SEGMENT]
    known = (past > 0) & (np.abs(grid.azimuth) > 2) & (segment < 20)
    assert known.sum() > 1000
    np.testing.assert_allclose(past[known], segment[known], rtol=0.01)


def test_held_out_rings_are_removed_from_the_past(dense: PointCloud, grid: RayGrid) -> None:
    rings = np.arange(64)
    whole = SparseScan(dense, grid.sensor, rings, read_past=lambda: [(dense, np.eye(4))])
    (then, _), *_ = whole.without(rings[rings % 4 != 0]).past
    assert then.ring is not None
    assert (then.ring % 4 == 0).all()


def test_the_guess_is_among_the_surrounding_surfaces(sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    """A board hangs before the wall: unsure are the rays between its last ring and the next one on the wall."""
    scan, image = sparse(), np.full((372, 1204, 3), 90, np.uint8)
    assert scan.cloud.ring is not None
    board = (scan.cloud.ring <= 8) & (np.abs(np.arctan2(scan.cloud.xyz[:, 1], scan.cloud.xyz[:, 0])) < 0.2)
    scan = replace(scan, cloud=scan.cloud.with_xyz(scan.cloud.xyz * np.where(board, 0.5, 1.0)[:, None]))
    calibration = replace(CALIBRATION, K=np.array([[700.0, 0, 600], [0, 700.0, 168], [0, 0, 1]]))
    given = lift_input(replace(scan, read_image=lambda: image, calibration=calibration), grid)
    guess, above, below = (given.candidates[which] for which in (Candidate.GUESS, Candidate.ABOVE, Candidate.BELOW))
    unsure = guess > 0
    assert unsure.sum() > 20
    assert (np.expm1(given.rays[Ray.SIGMA])[unsure] > 0.4).all()
    assert (given.rays[Ray.SEEN][unsure] > 0).all()
    assert (guess > 0.7 * np.minimum(above, below))[unsure].all()
    assert (guess < 1.3 * np.maximum(above, below))[unsure].all()


@pytest.mark.parametrize("phase", [1, 2, 3])
def test_features_work_for_any_phase(phase: int, sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    given = lift_input(sparse(phase), grid)
    assert (given.rows % 4 != phase).all()
    assert (given.rays[Ray.KNOWN] > 0).mean() > 0.3
