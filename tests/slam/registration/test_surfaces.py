"""Surface information of a cell's Gaussian: the directions in which its surface is thin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array
from slam.registration import kernels
from slam.registration.voxels import VoxelGaussians

ALONG, ACROSS, UP = np.eye(3)
SENSOR = np.array([0.5, -8.0, 0.4])  # looks along +y at the cell from (0, 0, 0) to (1, 1, 1)


def ones(xyz: Array) -> Array:
    return np.ones(len(xyz), np.float32)


def seen(xyz: Array, surfaces: bool = True, size: float = 1.0) -> VoxelGaussians:
    """Cells with points (N, 3) of the world, seen by a level sensor."""
    cells, pose = VoxelGaussians(size, 5, 1000, regularisation=0.003, surfaces=surfaces), np.eye(4)
    pose[:3, 3] = SENSOR
    cells.insert((xyz - SENSOR).astype(np.float32), ones(xyz), pose)
    return cells


def information(cells: VoxelGaussians) -> Array:
    """Information (3, 3) [1/m^2] of the cell from (0, 0, 0) to (1, 1, 1); 0 if it has none."""
    pose = np.eye(4)
    pose[:3, 3] = 0.5
    origin = np.zeros((1, 3), np.float32)
    return cells.normal_equations(origin, ones(origin), pose, 1, 1e9)[0][3:, 3:]


def along(cells: VoxelGaussians, direction: Array) -> float:
    """Standard deviation [m] of a point in the cell along a direction; infinite if it is unconstrained."""
    value = float(direction @ information(cells) @ direction)
    return 1 / np.sqrt(value) if value > 1e-9 else np.inf


def spread(low: list[float], high: list[float], count: int = 200, noise: float | Array = 0.01) -> Array:
    """Points (N, 3), uniform between two corners, with noise [m]."""
    rng = np.random.default_rng(1)
    return rng.uniform(low, high, (count, 3)) + rng.normal(0, noise, (count, 3))


def ring(y: float, z: float) -> Array:
    """Points (N, 3) of one ring, with errors along the beam."""
    return spread([0.05, y, z], [0.95, y, z], count=60, noise=0.01 * ACROSS + 0.001)


@settings(deadline=None, max_examples=200)
@given(
    st.lists(st.sampled_from([0.0, 1e-6, 1e-3, 1.0, 1.0 + 1e-9, 3.0, 500.0]), min_size=3, max_size=3),
    st.tuples(*[st.floats(-3, 3)] * 3),
)
@example([1e-6, 1e-6, 1e-6], (0.0, 0.0, 7e-115))  # the cube of the eigenvalues' spread underflows
def test_eigenvalues_and_vectors_are_those_of_numpy(values: list[float], turn: tuple[float, ...]) -> None:
    """Eigenvalues also if two or three are equal or zero; eigenvectors of simple eigenvalues."""
    axes = Rotation.from_rotvec(turn).as_matrix()
    matrix = axes @ np.diag(values) @ axes.T
    matrix = (matrix + matrix.T) / 2
    scale = max(*values, 1e-300)
    found, expected = kernels.eigenvalues(matrix), np.linalg.eigvalsh(matrix)
    np.testing.assert_allclose(found, expected, atol=1e-7 * scale)
    for value, neighbour in ((expected[0], expected[1]), (expected[2], expected[1])):
        if abs(value - neighbour) > 0.1 * scale:
            vector = np.array(kernels.eigenvector(matrix, value))
            np.testing.assert_allclose(matrix @ vector, value * vector, atol=1e-6 * scale)
            assert abs(np.linalg.norm(vector) - 1) < 1e-9


def test_a_pole_without_width_constrains_both_sides() -> None:
    pole = np.zeros((20, 3))
    pole[:, 2] = np.linspace(0.0, 1.0, 20)
    cells = seen(pole + np.array([0.5, 0.5, 0.0]))
    assert along(cells, ACROSS) < 0.05
    assert along(cells, np.cross(ACROSS, UP)) < 0.05


def test_a_wall_constrains_its_normal_only() -> None:
    wall = seen(spread([0.05, 0.5, 0.05], [0.95, 0.5, 0.95]))
    shares, axes = np.linalg.eigh(information(wall))
    assert abs(axes[:, 2] @ ACROSS) > np.cos(np.deg2rad(2))
    assert np.abs(shares[:2]).max() < 1e-9 * shares[2]
    assert 0.01 < along(wall, ACROSS) < 0.05  # the thickness, and the regularisation: a share of the width


def test_the_ground_is_constrained_by_two_rings_and_not_by_one() -> None:
    assert along(seen(ring(0.3, 0.5)), UP) == np.inf
    ground = seen(np.concatenate([ring(0.3, 0.5), ring(0.8, 0.5)]))
    assert along(ground, UP) < 0.05
    assert along(ground, ACROSS) > 10 * along(ground, UP)


@pytest.mark.parametrize("z", [0.1, 0.5, 0.9])
def test_the_trace_of_a_single_ring_on_a_wall_has_no_information(z: float) -> None:
    assert (information(seen(ring(0.5, z))) == 0).all()


def test_a_pole_across_rings_constrains_both_sides() -> None:
    """The visible strip of the pole, 20 cm wide."""
    pole = seen(spread([0.4, 0.5, 0.05], [0.6, 0.5, 0.95], count=60))
    assert along(pole, ALONG) < 0.1
    assert along(pole, ACROSS) < 0.05
    assert along(pole, UP) > 0.5  # the position along the pole is unconstrained


def test_a_clump_has_no_information() -> None:
    assert (information(seen(spread([0.5] * 3, [0.5] * 3, noise=0.1))) == 0).all()


def test_without_surfaces_the_information_is_the_inverse_covariance() -> None:
    """As in the paper: for a wall, the trace of a ring and a clump."""
    for xyz in (
        spread([0.05, 0.5, 0.05], [0.95, 0.5, 0.95]),
        spread([0.05, 0.5, 0.5], [0.95, 0.5, 0.5]),
        spread([0.5] * 3, [0.5] * 3, noise=0.1),
    ):
        covariance = np.cov(xyz.T)
        ridge = 0.003 * np.trace(covariance) + 1e-6
        expected = np.linalg.inv(covariance + ridge * np.eye(3))
        digits = 1e-5 * expected.max()  # of float32 points
        np.testing.assert_allclose(information(seen(xyz, surfaces=False)), expected, atol=digits)


@pytest.mark.parametrize("factor", [2, 4])
def test_coarser_cells_equal_those_made_of_the_points(factor: int) -> None:
    """Two walls, the ground, poles; compared by the normal equations of a scan half a cell away."""
    parts = [([-9, 4.3, -2], [9, 4.3, 3]), ([6.6, -9, -2], [6.6, 4.3, 3]), ([-9, -9, -1.7], [9, 9, -1.7])]
    poles = [([x, y, -1.7], [x, y, 2]) for x, y in ((-3.3, 2.2), (1.6, -4.4), (4.4, 1.4))]
    xyz = np.concatenate([*(spread(*ends, 4000) for ends in parts), *(spread(*ends) for ends in poles)])
    fine, coarse = seen(xyz).coarser(factor), seen(xyz, size=float(factor))
    assert len(fine) == len(coarse) > 30
    moved = (xyz + np.array([0.5, -0.3, 0.1])).astype(np.float32)
    found, expected = (cells.normal_equations(moved, ones(moved), np.eye(4), 1, 1.0) for cells in (fine, coarse))
    assert expected[2][4] > 1000  # points in a cell with a Gaussian
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6 * np.abs(other).max())


def points_met(cells: VoxelGaussians, point: list[float], sensor: list[float]) -> float:
    """1 if a point meets a Gaussian, seen by a level sensor, 0 if not."""
    pose = np.eye(4)
    pose[:3, 3] = sensor
    xyz = (np.array([point]) - sensor).astype(np.float32)
    return float(cells.normal_equations(xyz, ones(xyz), pose, 1, 1.0)[2][4])


@pytest.mark.parametrize(("ceiling", "met_from_above"), [(1.0, 0.0), (np.inf, 1.0)])
def test_a_floor_is_not_matched_to_the_ceiling_beneath_it(ceiling: float, met_from_above: float) -> None:
    below = [0.5, -2.0, -1.0]
    cells = VoxelGaussians(1.0, 5, 1000, regularisation=0.003, surfaces=True, ceiling=ceiling)
    underside = spread([0.05, 0.05, 0.4], [0.95, 0.95, 0.4])
    pose = np.eye(4)
    pose[:3, 3] = below
    cells.insert((underside - below).astype(np.float32), ones(underside), pose)
    for level in (cells, cells.coarser(2)):
        assert points_met(level, [0.5, 0.5, 0.6], below) == pytest.approx(1.0)
        assert points_met(level, [0.5, 0.5, 0.6], [0.5, -2.0, 2.0]) == pytest.approx(met_from_above)


def test_a_wall_is_matched_from_all_heights() -> None:
    cells = VoxelGaussians(1.0, 5, 1000, regularisation=0.003, surfaces=True, ceiling=1.0)
    wall = spread([0.05, 0.5, 0.05], [0.95, 0.5, 0.95])
    cells.insert(wall, ones(wall), np.eye(4))
    for height in (-3.0, 0.0, 3.0):
        assert points_met(cells, [0.5, 0.6, 0.5], [0.5, -2.0, height]) == pytest.approx(1.0)
