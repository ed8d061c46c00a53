"""Loops verified on a made-up street that is passed twice, and on a real one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.dataset import open_dataset
from slam.data.pose_files import read_poses
from slam.loops.submap import Submaps, submap
from slam.loops.verification import Verifier
from slam.mapping.keyframes import Keyframe
from slam.mapping.visibility import RangeImage
from slam.registration.voxels import VoxelGaussians
from slam.settings import VerificationSettings

Face = tuple[Array, Array, Array]  # corner and two edges
SHORT = VerificationSettings(match_submap_radius=4.0, query_submap_radius=2.0)
DRIFT = se3.exp(np.array([0.02, -0.01, 0.3, 15.0, -8.0, 1.0]))  # of the odometry between the two passes


def face(corner: Sequence[float], u: Sequence[float], v: Sequence[float]) -> Face:
    return np.array(corner, float), np.array(u, float), np.array(v, float)


def box(x: float, y: float, length: float, width: float, height: float) -> list[Face]:
    up = (0, 0, height)
    corner, across = (x, y, -1.7), (x, y + width, -1.7)
    return [
        face(corner, (length, 0, 0), up),
        face(corner, (0, width, 0), up),
        face(across, (length, 0, 0), up),
        face((x + length, y, -1.7), (0, width, 0), up),
    ]


def tunnel() -> list[Face]:
    """Along x, without ends in sight."""
    walls = [face((-60, y, -1.7), (120, 0, 0), (0, 0, 5)) for y in (-4.3, 4.6)]
    return [*walls, face((-60, -4.3, -1.7), (120, 0, 0), (0, 8.9, 0))]


def street(seed: int) -> list[Face]:
    """House fronts without a gap along x, the same for every seed, and cars, sheds and poles that differ."""
    rng = np.random.default_rng(seed)
    faces = [face((-45, y, -1.7), (90, 0, 0), (0, 0, 4)) for y in (-11.3, 12.4)]
    faces.append(face((-45, -11.3, -1.7), (90, 0, 0), (0, 23.7, 0)))
    for side in (-1, 1):
        x = -44.0
        while x < 40:
            length = rng.uniform(0.5, 4)
            faces += box(x, side * rng.uniform(5, 8), length, rng.uniform(0.5, 2.5), rng.uniform(2, 7))
            x += length + rng.uniform(1, 3)
    return faces


def seen(faces: list[Face], pose: Array, seed: int) -> PointCloud:
    """Scan of a sensor at `pose` up to 35 m: two points per square metre, half a point on the road, 2 cm noise."""
    rng, points = np.random.default_rng(seed), []
    for corner, u, v in faces:
        density = 2.0 if u[2] + v[2] else 0.5
        a, b = rng.random((2, int(density * np.linalg.norm(u) * np.linalg.norm(v)) + 1, 1))
        points.append(corner + a * u + b * v)
    xyz = np.concatenate(points) + rng.normal(0, 0.02, (sum(map(len, points)), 3))
    back = se3.inverse(pose)
    xyz = xyz @ back[:3, :3].T + back[:3, 3]
    xyz = xyz[np.linalg.norm(xyz, axis=1) < 35]
    return PointCloud(xyz, np.zeros(len(xyz)))


def at(x: float, y: float = 0.0, yaw_deg: float = 0.0) -> Array:
    pose = se3.exp(np.array([0, 0, np.deg2rad(yaw_deg), 0, 0, 0]))
    pose[:2, 3] = x, y
    return pose


def passes(first: list[Face], second: list[Face], query: Array, seed: int = 0, bent: float = 0.0) -> list[Keyframe]:
    """Five keyframes 2 m apart along x about the origin (2 is the match), two more up to `query` (6) with drift.

    `bent`: how far, in parts of 3 cm and 1 mrad, the odometry misplaces each of them.
    """
    rng = np.random.default_rng(seed)
    drives = [(first, at(x), np.eye(4), x + 4) for x in (-4.0, -2.0, 0.0, 2.0, 4.0)]
    drives += [(second, query @ at(x), DRIFT, 300 + x) for x in (-2.0, 0.0)]
    keyframes = []
    for index, (faces, truth, drift, way) in enumerate(drives):
        cloud = seen(faces, truth, 100 * seed + index)
        wrong = se3.exp(bent * rng.normal(0, [0.001] * 3 + [0.03] * 3))
        keyframes.append(Keyframe(index, drift @ truth @ wrong, way, cloud, RangeImage(0, np.zeros((0, 0), np.uint16))))
    return keyframes


def off(pose: Array, truth: Array) -> float:
    return float(np.linalg.norm((se3.inverse(truth) @ pose)[:3, 3]))


@hypothesis_settings(deadline=None, max_examples=10)
@given(st.floats(0, 2 * np.pi), st.sampled_from([-5.0, 5.0]), st.sampled_from([0.0, 180.0]))
def test_a_true_loop_is_accepted_from_a_poor_guess(heading: float, turn: float, yaw: float) -> None:
    query = at(0.7, -0.8, yaw)
    keyframes = passes(street(0), street(0), query)
    guess = at(3 * np.cos(heading), 3 * np.sin(heading)) @ query @ at(0, 0, turn)
    found = Verifier(SHORT).verify(keyframes, 6, 2, guess)
    assert found.accepted, found.reason
    assert off(found.T_match_query, query) < 0.2
    assert np.rad2deg(se3.angle(se3.inverse(query) @ found.T_match_query)) < 0.5
    assert np.linalg.eigvalsh(found.covariance)[0] > 0
    np.testing.assert_allclose(found.covariance, found.covariance.T, atol=1e-12)


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_similar_street_is_rejected(seed: int) -> None:
    found = Verifier(SHORT).verify(passes(street(0), street(seed), at(0)), 6, 2, at(0))
    assert not found.accepted
    assert found.reason in ("low coarse score", "few inliers", "low overlap", "ambiguous", "degenerate")


def test_a_tunnel_is_rejected() -> None:
    """It fits well in both directions, and as well at any other place along it."""
    found = Verifier(SHORT).verify(passes(tunnel(), tunnel(), at(0)), 6, 2, at(1.5))
    assert found.inlier_ratio > 0.7
    assert found.overlap > 0.3
    assert found.distinctness < 0.1
    assert found.reason == "ambiguous"


def test_a_place_farther_along_the_street_is_rejected_or_located() -> None:
    query = at(14.0)
    found = Verifier(SHORT).verify(passes(street(0), street(0), query), 6, 2, at(1.0))
    assert not found.accepted


def test_a_pose_far_from_the_guess_is_rejected() -> None:
    narrow = SHORT.model_copy(update={"max_correction": 1.0})
    found = Verifier(narrow).verify(passes(street(0), street(0), at(0)), 6, 2, at(3.0))
    assert found.reason == "far from guess"


def test_the_covariance_agrees_with_the_spread() -> None:
    """Each of 50 repetitions with points, noise and bent submaps of its own; per degree of freedom."""
    squared = []
    for seed in range(50):
        found = Verifier(SHORT).verify(passes(street(0), street(0), at(0.7, 0.4), seed, bent=1.0), 6, 2, at(0))
        error = se3.log(se3.inverse(at(0.7, 0.4)) @ found.T_match_query)
        squared.append(error**2 / np.diag(found.covariance))
    normalised = np.sqrt(np.mean(squared, axis=0))
    assert (normalised > 0.3).all()
    assert (normalised < 3).all()


@pytest.mark.parametrize("empty", [2, 6])
def test_empty_clouds_are_rejected(empty: int) -> None:
    keyframes = passes(street(0), street(0), at(0))
    nothing = PointCloud(np.zeros((0, 3)), np.zeros(0))
    keyframes = [
        replace(keyframe, cloud=nothing) if abs(keyframe.index - empty) < 3 else keyframe for keyframe in keyframes
    ]
    found = Verifier(SHORT).verify(keyframes, 6, 2, at(0))
    assert found.reason == "few points"
    assert np.linalg.eigvalsh(found.covariance)[0] > 0


def test_verification_is_deterministic() -> None:
    keyframes, verifier = passes(street(0), street(0), at(1)), Verifier(SHORT)
    first, again = (v.verify(keyframes, 6, 2, at(0)) for v in (verifier, Verifier(SHORT)))
    verifier.verify(keyframes, 2, 6, at(0))
    third = verifier.verify(keyframes, 6, 2, at(0))
    for other in (again, third):
        np.testing.assert_array_equal(first.T_match_query, other.T_match_query)
        np.testing.assert_array_equal(first.covariance, other.covariance)
        assert (first.inlier_ratio, first.overlap) == (other.inlier_ratio, other.overlap)


def test_a_different_place_is_rejected_before_it_is_registered_in_fine_cells() -> None:
    strict = SHORT.model_copy(update={"min_coarse_score": 0.95})
    found = Verifier(strict).verify(passes(street(0), street(1), at(0)), 6, 2, at(0))
    assert found.reason == "low coarse score"
    assert np.isnan([found.inlier_ratio, found.overlap, found.distinctness]).all()


def test_kept_submaps_give_the_same_result() -> None:
    keyframes = passes(street(0), street(0), at(1))
    keyframes.append(replace(keyframes[-1], index=7, pose=keyframes[-1].pose @ at(9.0), travelled=310.0))
    verifier = Verifier(SHORT)
    first, again = (verifier.verify(keyframes, 6, 2, at(0)) for _ in range(2))
    assert first.accepted
    np.testing.assert_array_equal(first.T_match_query, again.T_match_query)
    assert (first.inlier_ratio, first.overlap) == (again.inlier_ratio, again.overlap)


def test_fine_cells_are_computed_once_and_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[float] = []
    compact = VoxelGaussians.compact
    monkeypatch.setattr(VoxelGaussians, "compact", lambda cells: (built.append(cells.size), compact(cells)))
    keyframes = passes(street(0), street(0), at(1))
    keyframes.append(replace(keyframes[-1], index=7, pose=keyframes[-1].pose @ at(9.0), travelled=310.0))
    verifier = Verifier(SHORT)
    verifier.verify(keyframes, 6, 2, at(0))
    assert sorted(built) == [1.0, 1.0, 2.0, 4.0]  # those of 1 m of both submaps
    verifier.verify(keyframes, 6, 2, at(0))
    assert sorted(built[4:]) == [1.0, 2.0]  # of the match: the coarsest are kept, and the query's


def test_a_submap_is_kept_only_when_no_later_keyframe_can_join_it() -> None:
    point = PointCloud(np.array([[1.0, 0, 0]]), np.zeros(1))
    view = RangeImage(0, np.zeros((0, 0), np.uint16))
    keyframes = [Keyframe(k, at(2.0 * k), 2.0 * k, point, view) for k in range(6)]
    submaps = Submaps(VerificationSettings(), radius=2.5, kept=1)
    assert len(submaps.around(keyframes[:4], 2)) == 3  # keyframes 1 to 3; 4 is missing, at 4 m of 6.5
    assert len(submaps.around(keyframes[:3], 2)) == 2
    complete = submaps.around(keyframes, 2)
    assert len(complete) == 3
    assert submaps.around(keyframes, 2) is complete
    submaps.around(keyframes, 1)
    assert submaps.around(keyframes, 2) is not complete  # only one is kept


def test_a_submap_covers_its_radius() -> None:
    point = PointCloud(np.array([[1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0]]), np.zeros(3))
    view = RangeImage(0, np.zeros((0, 0), np.uint16))
    keyframes = [Keyframe(k, at(2.0 * k), 2.0 * k, point, view) for k in range(6)]
    assert sorted(submap(keyframes, 2, 2.5, 9)[:, 0]) == [-1, 0, 1, 1, 2, 3, 3, 4, 5]
    assert sorted(submap(keyframes, 0, 2.0, 2)[:, 0]) == [1, 3, 3, 5]


def test_a_recorded_revisit_in_the_reverse_direction_is_accepted(real_data: Callable[[str], Path]) -> None:
    """NCLT: keyframes 500 and 378 are of one place; 420, some 40 m from it, is another."""
    folder = real_data("nclt_20130110")
    poses, dataset = read_poses(folder / "odometry_tum.txt")[1], open_dataset(folder / "keyframes")
    keyframes = []
    for position in [*range(370, 386), *range(412, 428), *range(495, 501)]:
        cloud = dataset[position].cloud
        keyframes.append(Keyframe(position, poses[position], 1.07 * position, cloud, RangeImage.of(cloud)))
    truth = se3.inverse(poses[378]) @ poses[500]
    found = Verifier().verify(keyframes, len(keyframes) - 1, 8, truth @ at(1.5, -1.0, 4.0))
    assert found.accepted, found.reason
    assert off(found.T_match_query, truth) < 0.5
    assert not Verifier().verify(keyframes, len(keyframes) - 1, 24, truth).accepted
