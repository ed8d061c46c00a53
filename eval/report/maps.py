"""Maps of runs: read and thinned for the page, density and sharpness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from eval.report.content import Report
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.point_files import Points, read_points

#: Points of all maps of a page together, and of one map: 10 bytes a point and software rendering set the limits.
ALL, ONE = 360_000, 120_000
CELL = 1.0  # m: squares of the density
MOST_SQUARES, TABLE = 1 << 26, 1 << 12  # squares that are counted in a table; side of a table of squares
#: Radius [m] and fewest neighbours of a neighbourhood, and number of points whose neighbourhoods are averaged.
RADIUS, NEIGHBOURS, SAMPLED = 0.5, 8, 2_000


@dataclass(frozen=True)
class Sharpness:
    """Sharpness of a map; lower is sharper, and only maps of similar density can be compared.

    Attributes:
        entropy: Mean map entropy [nats]: mean over points of ln |2 pi e S| / 2, S the covariance of the neighbours
            within 0.5 m (Droeschel and Behnke, "Efficient continuous-time SLAM for 3D lidar-based online mapping",
            ICRA 2018; Razlaw et al., "Evaluation of registration methods for sparse 3D laser scans", ECMR 2015).
        thickness_m: Median distance of the neighbours from their plane [m], the square root of the least eigenvalue of
            S; after the mean plane variance of Razlaw et al.
    """

    entropy: float
    thickness_m: float


@dataclass(frozen=True)
class MapFigures:
    """Figures of a map.

    Attributes:
        points: Number of points.
        density: Points per square metre of the squares of 1 m, seen from above, that have any.
        sharpness: None if too few points have neighbours.
    """

    points: int
    density: float
    sharpness: Sharpness | None


def read_maps(report: Report) -> dict[str, Points]:
    """Return the map of each run that has one, by its label.

    Raises:
        InputError: A map is damaged.
    """
    paths = {row.label: run.folder / "map.pcd" for row, run in report.runs}
    maps = {}
    for label, path in paths.items():
        if path.is_file():
            points = read_points(path)
            if points.intensity is None:
                raise InputError(f"{path}: has no intensity; it is not the map of a run, so run again")
            maps[label] = points
    return maps


def figures_of(xyz: Array) -> MapFigures:
    """Compute the figures of a map with points (N, 3) [m], N > 0."""
    squares = _occupied(xyz, CELL)
    return MapFigures(len(xyz), len(xyz) / (squares * CELL**2), sharpness(xyz))


def sharpness(xyz: Array, seed: int = 0) -> Sharpness | None:
    """Compute the sharpness of a map over SAMPLED of its points.

    Args:
        xyz: Points (N, 3) [m].
        seed: Seed of the choice of points.

    Returns:
        The figures; None if no point has NEIGHBOURS neighbours.

    Example:
        >>> x, y = np.mgrid[0:3:0.2, 0:3:0.2]
        >>> flat = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
        >>> round(sharpness(flat).thickness_m, 3)
        0.0
    """
    samples = xyz[np.random.default_rng(seed).permutation(len(xyz))[:SAMPLED]].astype(np.float64)
    points = _near(xyz, samples).astype(np.float64)  # a tree of the whole map can take minutes
    neighbours = cKDTree(points).query_ball_point(samples, RADIUS)
    counts = np.array([len(each) for each in neighbours])
    if not (enough := counts >= NEIGHBOURS).any():
        return None
    spreads = _covariances(points[np.concatenate(neighbours[enough])], counts[enough])
    eigenvalues = np.maximum(np.linalg.eigvalsh(spreads), 1e-12)  # a micrometre: exactly flat has entropy -inf
    entropy = 0.5 * np.log(2 * np.pi * np.e * eigenvalues).sum(axis=1)
    return Sharpness(float(entropy.mean()), float(np.median(np.sqrt(eigenvalues[:, 0]))))


def thinned(maps: Mapping[str, Points], seed: int = 0) -> tuple[dict[str, Points], float]:
    """Thin maps for the page, all to the same share of their points, so that their densities can be compared by eye.

    Args:
        maps: Maps by label.
        seed: Seed of the choice of points.

    Returns:
        The thinned maps, and the share of the points that they keep.
    """
    sizes = [len(points.xyz) for points in maps.values()]
    share = min(1.0, ALL / max(sum(sizes), 1), ONE / max(max(sizes, default=1), 1))
    return {label: _some(points, share, seed) for label, points in maps.items()}, share


def _occupied(xyz: Array, size: float) -> int:
    """Number of squares of `size` [m], seen from above, in which points (N, 3) lie."""
    column, row = _square(xyz, size)
    width, height = np.ptp(column) + 1, np.ptp(row) + 1
    if width * height > MOST_SQUARES:
        return len(np.unique((column.astype(np.int64) << 32) + row))
    occupied = np.zeros((width, height), bool)
    occupied[column - column.min(), row - row.min()] = True
    return int(occupied.sum())


def _near(xyz: Array, samples: Array) -> Array:
    """The points (N, 3) in the squares of samples (M, 3) and in the squares around these, and perhaps more."""
    (column, row), (columns, rows) = _square(xyz, RADIUS), _square(samples, RADIUS)
    near = np.zeros((TABLE, TABLE), bool)  # squares share places beyond TABLE of them
    for right in (-1, 0, 1):
        for up in (-1, 0, 1):
            near[(columns + right) % TABLE, (rows + up) % TABLE] = True
    return xyz[near[column % TABLE, row % TABLE]]


def _square(xyz: Array, size: float) -> tuple[Array, Array]:
    """Column and row (N,) int32 of the squares of `size` [m], seen from above, in which points (N, 3) lie."""
    column, row = (np.floor(xyz[:, axis] / np.float32(size)).astype(np.int32) for axis in (0, 1))
    return column, row


def _covariances(points: Array, counts: Array) -> Array:
    """Covariances (K, 3, 3) of groups of points (N, 3), `counts` (K,) after each other."""
    starts = np.cumsum(counts) - counts
    mean = np.add.reduceat(points, starts) / counts[:, None]
    off = points - np.repeat(mean, counts, axis=0)
    products = off[:, :, None] * off[:, None]
    return np.asarray(np.add.reduceat(products, starts) / counts[:, None, None])


def _some(points: Points, share: float, seed: int) -> Points:
    count = len(points.xyz)
    kept = np.sort(np.random.default_rng(seed).permutation(count)[: max(1, round(share * count))])
    assert points.intensity is not None
    colour = None if points.colour is None else points.colour[kept]
    return Points(points.xyz[kept], points.intensity[kept], colour=colour)
