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
    squares = len(np.unique(_square(xyz, CELL)))
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
    offsets = RADIUS * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 1, 2)
    around = np.unique(_square(samples[:, :2] + offsets, RADIUS))
    points = xyz[np.isin(_square(xyz, RADIUS), around)].astype(np.float64)  # a tree of the whole map can take minutes
    neighbours = cKDTree(points).query_ball_point(samples, RADIUS)
    spreads = np.array([np.cov(points[each].T, bias=True) for each in neighbours if len(each) >= NEIGHBOURS])
    if len(spreads) == 0:
        return None
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


def _square(xy: Array, size: float) -> Array:
    """One number for each square of `size` [m], seen from above, in which points (..., 2 or 3) lie."""
    column, row = np.moveaxis(np.floor(xy[..., :2] / size).astype(np.int64), -1, 0)
    return np.asarray((column << 32) + row)


def _some(points: Points, share: float, seed: int) -> Points:
    count = len(points.xyz)
    kept = np.sort(np.random.default_rng(seed).permutation(count)[: max(1, round(share * count))])
    assert points.intensity is not None
    colour = None if points.colour is None else points.colour[kept]
    return Points(points.xyz[kept], points.intensity[kept], colour=colour)
