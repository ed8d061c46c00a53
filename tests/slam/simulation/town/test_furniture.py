from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slam.simulation.materials import INDEX, MATERIALS
from slam.simulation.mesh import Mesh
from slam.simulation.town.furniture import (
    FOOT,
    bench,
    bollard,
    electric_box,
    fence,
    lamp,
    sign,
    wheelie_bin,
)
from slam.simulation.world import StandingWorld, World

Piece = tuple[Callable[[np.random.Generator], Mesh], float, float, float]

LENGTH = 6.0

#: Each piece with the least and greatest height and how far it may reach from its place.
PIECES: dict[str, Piece] = {
    "lamp": (lamp, 4, 9.8, 2.6),
    "sign": (sign, 2.3, 3.5, 0.7),
    "bollard": (bollard, 0.5, 1.11, 0.2),
    "bin": (wheelie_bin, 0.85, 1.1, 0.5),
    "bench": (bench, 0.8, 0.9, 1.1),
    "box": (electric_box, 0.9, 1.5, 0.8),
    "fence": (lambda rng: fence(rng, LENGTH), 0.8, 2.0, LENGTH),
}


@pytest.fixture(params=list(PIECES))
def piece(request: pytest.FixtureRequest) -> Piece:
    return PIECES[request.param]


def test_the_same_generator_gives_the_same_piece(piece: Piece) -> None:
    one, other = (piece[0](np.random.default_rng(3)) for _ in range(2))
    for part in ("vertices", "triangles", "material", "colour"):
        np.testing.assert_array_equal(getattr(one, part), getattr(other, part))


def test_pieces_differ(piece: Piece) -> None:
    made = {piece[0](np.random.default_rng(seed)).vertices.tobytes() for seed in range(12)}
    made_of = {piece[0](np.random.default_rng(seed)).colour.tobytes() for seed in range(12)}
    assert max(len(made), len(made_of)) >= 4


def test_size(piece: Piece) -> None:
    make, lowest, highest, reach = piece
    for seed in range(25):
        vertices = make(np.random.default_rng(seed)).vertices
        assert lowest <= vertices[:, 2].max() <= highest
        assert -FOOT - 1e-9 <= vertices[:, 2].min() < -0.2
        assert np.abs(vertices[:, :2]).max() <= reach


def test_triangles(piece: Piece) -> None:
    for seed in range(25):
        mesh = piece[0](np.random.default_rng(seed))
        a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-7
        assert 20 <= len(mesh) <= 150
        assert mesh.material.max() < len(MATERIALS)


@pytest.mark.parametrize("length", [2.0, 3.7, 12.0, 31.0])
def test_a_fence_has_the_length_it_was_asked_for(length: float) -> None:
    for seed in range(20):
        mesh = fence(np.random.default_rng(seed), length)
        assert len(mesh) <= 40 * length
        x, y, _ = mesh.vertices.T
        assert x.min() == pytest.approx(0, abs=0.02)
        assert x.max() == pytest.approx(length, abs=0.02)
        assert np.abs(y).max() < 0.2


def test_most_fences_let_some_rays_through() -> None:
    x, z = np.meshgrid(np.arange(0.1, LENGTH - 0.1, 0.02), np.arange(0.1, 0.8, 0.05))
    origin = np.column_stack([x.ravel(), np.full(x.size, -5.0), z.ravel()])
    towards = np.tile([0.0, 1.0, 0.0], (x.size, 1))
    stopped = [
        World(StandingWorld(fence(np.random.default_rng(seed), LENGTH))).hidden(origin, towards).mean()
        for seed in range(20)
    ]
    assert sum(0.05 < share < 0.95 for share in stopped) >= 10


def test_signs_shine_to_the_street_and_are_grey_behind() -> None:
    for seed in range(15):
        world = World(StandingWorld(sign(np.random.default_rng(seed))))
        x, z = np.meshgrid(np.arange(-0.6, 0.6, 0.02), np.arange(1.6, 3.4, 0.02))
        for side, seen in ((-1, True), (1, False)):
            origin = np.column_stack([x.ravel(), np.full(x.size, 5.0 * side), z.ravel()])
            hit = world.cast(origin, np.tile([0.0, -side, 0.0], (x.size, 1))).triangle
            shining = world.material[hit[hit >= 0]] == INDEX["sign"]
            assert shining.any() == seen
