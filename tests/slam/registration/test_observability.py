"""Observable directions of a scan, by the surfaces that it is matched to."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.registration import observability
from slam.registration.observability import unobserved
from slam.registration.voxels import VoxelGaussians

Face = tuple[list[float], list[float]]  # opposite corners of a rectangle along the axes

GROUND: Face = ([-30, -30, -1.7], [30, 30, -1.7])
TUNNEL: list[Face] = [
    ([-30, -4.3, -1.7], [30, 4.4, -1.7]),
    ([-30, -4.3, 3.6], [30, 4.4, 3.6]),
    ([-30, -4.3, -1.7], [30, -4.3, 3.6]),
    ([-30, 4.4, -1.7], [30, 4.4, 3.6]),
]
ROOM: list[Face] = [*TUNNEL, ([-30, -4.3, -1.7], [-30, 4.4, 3.6]), ([30, -4.3, -1.7], [30, 4.4, 3.6])]
NICHE: list[Face] = [*TUNNEL, ([8.4, -4.3, -1.7], [8.4, -3.3, 0.3])]
NONE = np.zeros((0, 3))


def sampled(faces: list[Face], seed: int, density: float, noise: float) -> Array:
    """Points (N, 3) float32 with `density` points per square metre and noise [m]."""
    rng, parts = np.random.default_rng(seed), []
    for low, high in faces:
        sides = np.subtract(high, low)
        count = int(density * np.prod(sides[sides > 0]))
        parts.append(rng.uniform(low, high, (count, 3)))
    xyz = np.concatenate(parts)
    return (xyz + rng.normal(0, noise, xyz.shape)).astype(np.float32)


def seen(faces: list[Face], turn: float = 0.0, noise: float = 0.02) -> tuple[VoxelGaussians, Array, Array, Array]:
    """A map of the scene, rotated by `turn` [rad], and a scan in it: cells, points, weights, pose."""
    pose = se3.exp(np.array([0, 0, turn, 0, 0, 0]))
    cells = VoxelGaussians(1.0, 5, 1000, 0.003, surfaces=True)
    cloud, xyz = sampled(faces, 0, 15.0, noise), sampled(faces, 1, 2.0, noise)
    cells.insert(cloud, np.ones(len(cloud), np.float32), pose)
    return cells, xyz, np.ones(len(xyz), np.float32), pose


def unobserved_in(faces: list[Face], before: Array = NONE, **options: float) -> Array:
    return unobserved(*seen(faces, **options), 1.0, before)


@pytest.mark.parametrize("noise", [0.005, 0.02, 0.04])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_the_axis_of_a_tunnel_is_unobservable(noise: float, turn: float) -> None:
    """Even with noise: a thousand normals tilted by noise face the axis as much as a wall of 2 sqm."""
    (direction,) = unobserved_in(TUNNEL, turn=turn, noise=noise)
    assert abs(direction @ [np.cos(turn), np.sin(turn), 0]) > np.cos(np.deg2rad(3))
    assert np.linalg.norm(direction) == pytest.approx(1)


def test_all_directions_of_a_room_are_observable() -> None:
    assert unobserved_in(ROOM).shape == (0, 3)


def test_a_plane_constrains_one_direction() -> None:
    directions = unobserved_in([GROUND])
    assert directions.shape == (2, 3)
    np.testing.assert_allclose(directions @ directions.T, np.eye(2), atol=1e-9)
    assert np.abs(directions[:, 2]).max() < np.sin(np.deg2rad(2))


def test_an_unobservable_direction_becomes_observable_above_a_higher_threshold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hysteresis: with a niche in the tunnel, between the two thresholds, the direction keeps its state."""
    scene = seen(NICHE)
    cells, *scan = scene
    share = cells.facing(*cells.support(*scan, 1.0)[1:], np.eye(3))[0]
    monkeypatch.setattr(observability, "MIN_SHARE", share / 2)
    monkeypatch.setattr(observability, "REOBSERVED_SHARE", share * 2)
    assert len(unobserved(*scene, 1.0, NONE)) == 0
    (direction,) = unobserved(*scene, 1.0, np.array([[1.0, 0, 0]]))
    assert abs(direction[0]) > 0.99
    assert len(unobserved(*scene, 1.0, np.array([[0, 1.0, 0]]))) == 0  # the state of another direction does not matter
    monkeypatch.setattr(observability, "REOBSERVED_SHARE", share * 0.9)
    assert len(unobserved(*scene, 1.0, np.array([[1.0, 0, 0]]))) == 0
