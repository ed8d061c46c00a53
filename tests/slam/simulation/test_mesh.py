from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.data.cloud import Array
from slam.simulation.materials import COLOURS, INDEX
from slam.simulation.mesh import Mesh, box, cylinder, fan, grid, joined, loft, prism, quads

HEXAGON = np.array([(np.cos(turn), np.sin(turn), 0.0) for turn in np.arange(6) * np.pi / 3])
HEXAGON_AREA = 1.5 * np.sqrt(3)
SQUARE = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])

size = st.floats(0.05, 20)


def areas(mesh: Mesh) -> Array:
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def volume(mesh: Mesh) -> float:
    """Inside a closed mesh; positive where its triangles are counter-clockwise as seen from outside."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge has two triangles, which pass it in opposite directions."""
    around = np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges = Counter(map(tuple, around.tolist()))
    return all(count == 1 and edges[stop, start] == 1 for (start, stop), count in edges.items())


def bend(stops: int) -> Array:
    """A quarter of a circle of radius 1, from upright to along x."""
    turn = np.linspace(0, np.pi / 2, stops)
    return np.column_stack([1 - np.cos(turn), 0 * turn, np.sin(turn)])


@pytest.mark.parametrize(
    "solid",
    [
        box((2, 3, 4), "brick"),
        prism(SQUARE[:3], 2.0, "roof"),
        prism(HEXAGON, 0.5, "concrete"),
        cylinder([0.1, 0.05], [(0, 0, -0.3), (0, 0, 6)], 3, "bark"),
        cylinder([0.1] * 9, bend(9), 8, "metal"),
        loft(np.stack([HEXAGON, 2 * HEXAGON + np.array([0, 0, 1]), HEXAGON + np.array([1, 0, 2])]), "plaster"),
    ],
    ids=["box", "wedge", "prism", "bough", "arm", "loft"],
)
def test_solids_are_closed_and_every_triangle_is_one(solid: Mesh) -> None:
    assert is_closed(solid)
    assert volume(solid) > 0
    assert areas(solid).min() > 1e-4
    assert len(np.unique(solid.triangles)) == len(solid.vertices)


@given(size, size, size)
def test_a_box_has_the_area_and_volume_of_one_and_stands_on_the_origin(x: float, y: float, z: float) -> None:
    mesh = box((x, y, z), "brick")
    assert areas(mesh).sum() == pytest.approx(2 * (x * y + y * z + z * x))
    assert volume(mesh) == pytest.approx(x * y * z)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [-x / 2, -y / 2, 0])
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [x / 2, y / 2, z])


def test_a_prism_has_a_top_a_bottom_and_sides() -> None:
    mesh = prism(HEXAGON, 3.0, "concrete")
    assert len(mesh) == 4 + 4 + 12
    assert areas(mesh).sum() == pytest.approx(2 * HEXAGON_AREA + 6 * 3.0)
    assert volume(mesh) == pytest.approx(3 * HEXAGON_AREA)


@given(size, size, st.tuples(*[st.floats(-5, 5)] * 3).filter(lambda way: np.linalg.norm(way) > 0.1))
def test_a_straight_cylinder_is_a_frustum_in_any_direction(foot: float, top: float, way: tuple[float, ...]) -> None:
    mesh = cylinder([foot, top], np.array([(1, 2, 3), np.add(way, (1, 2, 3))]), 6, "wood")
    assert is_closed(mesh)
    height = np.linalg.norm(way)
    assert volume(mesh) == pytest.approx(HEXAGON_AREA * height / 3 * (foot**2 + foot * top + top**2))
    slant = np.sqrt(height**2 + 0.75 * (foot - top) ** 2)
    sides = 6 * slant * (foot + top) / 2
    assert areas(mesh).sum() == pytest.approx(HEXAGON_AREA * (foot**2 + top**2) + sides)


def test_a_bent_cylinder_does_not_twist() -> None:
    mesh = cylinder([0.1] * 17, bend(17), 6, "metal")
    assert volume(mesh) == pytest.approx(0.01 * HEXAGON_AREA * np.pi / 2, rel=0.01)
    assert np.hypot(mesh.vertices[-6:, 1], mesh.vertices[-6:, 2] - 1) == pytest.approx(0.1, rel=0.01)


def test_a_fan_fills_its_outline() -> None:
    mesh = fan(HEXAGON + np.array([5, 6, 7]), "sign", (1, 2, 3))
    assert len(mesh) == 4
    assert areas(mesh).sum() == pytest.approx(HEXAGON_AREA)
    assert (mesh.colour == (1, 2, 3)).all()


def test_quads_are_two_triangles_each() -> None:
    mesh = quads(np.stack([SQUARE, 3 * SQUARE]), "glass")
    np.testing.assert_allclose(areas(mesh), [0.5, 0.5, 4.5, 4.5])


def test_a_grid_covers_its_points_row_after_row() -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    mesh = grid(np.dstack([x, y, 0 * x]), "grass")
    np.testing.assert_array_equal(mesh.vertices[:5], [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (0, 1, 0)])
    np.testing.assert_allclose(areas(mesh), 0.5)
    cells = mesh.vertices[mesh.triangles].reshape(6, 2, 3, 3).mean(axis=(1, 2))
    np.testing.assert_allclose(cells[:, :2], [(0.5 + i, 0.5 + j) for j in range(2) for i in range(3)], atol=0.01)
    edges = mesh.vertices[mesh.triangles]
    assert (np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])[:, 2] > 0).all()


def test_a_material_brings_its_own_colour_unless_told_another() -> None:
    own, other = box((1, 1, 1), "brick"), box((1, 1, 1), "brick", (9, 8, 7))
    assert (own.material == INDEX["brick"]).all()
    assert (own.colour == COLOURS[INDEX["brick"]]).all()
    assert (other.colour == (9, 8, 7)).all()


def test_placing_scales_then_turns_then_moves() -> None:
    mesh = quads(SQUARE, "marking")
    placed = mesh.placed(10, 20, 30, np.pi / 2, scale=2)
    np.testing.assert_allclose(placed.vertices, [(10, 20, 30), (10, 22, 30), (8, 22, 30), (8, 20, 30)])
    T = np.array([[0, -2, 0, 10], [2, 0, 0, 20], [0, 0, 2, 30], [0, 0, 0, 1.0]])
    np.testing.assert_allclose(mesh.moved(T).vertices, placed.vertices)
    np.testing.assert_array_equal(mesh.vertices, SQUARE)


def test_selected_triangles_keep_what_they_are_and_only_their_vertices() -> None:
    both = joined([box((1, 1, 1), "brick"), quads(SQUARE + np.array([0, 0, 5]), "glass", (1, 2, 3))])
    by_mask, by_index = both.select(both.material == INDEX["glass"]), both.select(np.array([12, 13]))
    for part in (by_mask, by_index):
        assert len(part) == 2
        assert part.triangles.dtype == np.int32
        np.testing.assert_array_equal(part.vertices, SQUARE + np.array([0, 0, 5]))
        np.testing.assert_array_equal(part.vertices[part.triangles], both.vertices[both.triangles[12:]])
        assert (part.material == INDEX["glass"]).all()
        assert (part.colour == (1, 2, 3)).all()
    nothing = both.select(np.zeros(len(both), bool))
    assert len(nothing) == len(nothing.vertices) == 0


def test_joined_meshes_keep_their_order_and_their_triangles() -> None:
    parts = [box((1, 1, 1), "brick"), joined([]), quads(SQUARE, "glass"), box((2, 2, 2), "wood", (1, 2, 3))]
    whole = joined(iter(parts))
    assert len(whole) == 12 + 0 + 2 + 12
    corners = [part.vertices[part.triangles] for part in parts]
    np.testing.assert_array_equal(whole.vertices[whole.triangles], np.concatenate(corners))
    np.testing.assert_array_equal(
        whole.material, np.repeat([INDEX["brick"], INDEX["glass"], INDEX["wood"]], [12, 2, 12])
    )
    np.testing.assert_array_equal(whole.colour[-12:], np.tile((1, 2, 3), (12, 1)))


def test_nothing_joined_is_an_empty_mesh() -> None:
    empty, mesh = joined([]), box((1, 1, 1), "brick")
    assert len(empty) == 0
    for part in ("vertices", "triangles", "material", "colour"):
        assert getattr(empty, part).dtype == getattr(mesh, part).dtype
        assert getattr(empty, part).shape[1:] == getattr(mesh, part).shape[1:]
