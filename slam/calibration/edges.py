"""Edges that a LiDAR sees: jumps of the range and of the intensity from one ray to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array, PointCloud

MIN_JUMP, MIN_JUMP_SHARE = 0.5, 0.1  # m, and of the nearer range
MAX_STEP = np.deg2rad(0.6)  # in azimuth; wider gaps between two rays do not locate the edge
MAX_RING_STEP = np.deg2rad(1.2)  # in elevation, likewise
MAX_OFFSET = np.deg2rad(0.2)  # in azimuth, of the neighbour in the adjacent ring
SAME_SURFACE = 0.02  # relative difference of the ranges of two neighbours on one surface, at most
MIN_CONTRAST, CONTRAST_PERCENTILE = 0.1, 98.0  # of the intensities, 0..1; road markings and signs
TURN = 10.0  # more than 2 pi

SIDE, TOP, MARK = 0, 1, 2  # kinds of edges


@dataclass(frozen=True, eq=False)
class Edges:
    """E edges between a ray and the next one.

    Attributes:
        near: (E,) index of the point: the last one on a surface in front of another, or on one side of a mark.
        xyz: (E, 3) float64, the point [m].
        step: (E, 3) [m], from the point to where the next ray meets the same surface.
        kind: (E,) SIDE: the surface ends along the ring; TOP: at the ring above; MARK: its intensity changes.
    """

    near: Array
    xyz: Array
    step: Array
    kind: Array


def find_edges(cloud: PointCloud) -> Edges:
    """Find the edges in a deskewed scan with rings.

    Lower ends of surfaces are left out: lasers at different heights see past each other there, and foliage hangs.
    """
    assert cloud.ring is not None
    xyz = cloud.xyz.astype(np.float64)
    range_ = np.linalg.norm(xyz, axis=1)
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    along, across = _neighbours(azimuth, cloud.ring)
    side, beside = _jumps(np.concatenate([along, along[:, ::-1]]), range_)
    top, above = _jumps(across[:, ::-1], range_)
    spacing = _spacing(xyz, range_, across, cloud.ring)[cloud.ring[above]]
    top, spacing = top[spacing < MAX_RING_STEP], spacing[spacing < MAX_RING_STEP]
    mark, next_ = _contrasts(along, range_, cloud.intensity)
    steps = (
        _sideways(xyz[side], azimuth[beside] - azimuth[side]),
        _upwards(xyz[top], spacing),
        _sideways(xyz[mark], azimuth[next_] - azimuth[mark]),
    )
    near = np.concatenate([side, top, mark])
    kind = np.repeat(np.array([SIDE, TOP, MARK], np.uint8), [len(side), len(top), len(mark)])
    return Edges(near, xyz[near], np.concatenate(steps), kind)


def _neighbours(azimuth: Array, ring: Array) -> tuple[Array, Array]:
    """Index pairs (P, 2) of neighbours within a ring, and (Q, 2) of a ring and the one below."""
    order = np.lexsort((azimuth, ring))
    if len(order) < 2:
        return np.zeros((0, 2), np.int64), np.zeros((0, 2), np.int64)
    place = ring[order] * TURN + azimuth[order]  # rising
    along = np.column_stack([order[:-1], order[1:]])[np.diff(place) < MAX_STEP]
    wanted = place + TURN
    after = np.searchsorted(place, wanted).clip(1, len(place) - 1)
    after -= wanted - place[after - 1] < place[after] - wanted
    return along, np.column_stack([order, order[after]])[np.abs(place[after] - wanted) < MAX_OFFSET]


def _jumps(pairs: Array, range_: Array) -> tuple[Array, Array]:
    """Near and far indices of the pairs whose second point is much farther than the first."""
    near, far = pairs.T
    jump = range_[far] - range_[near] > np.maximum(MIN_JUMP, MIN_JUMP_SHARE * range_[near])
    return near[jump], far[jump]


def _contrasts(pairs: Array, range_: Array, intensity: Array) -> tuple[Array, Array]:
    """First and second indices of the pairs on one surface with the largest differences of intensity."""
    first, second = pairs[_same_surface(pairs, range_)].T
    change = np.abs(intensity[first] - intensity[second])
    least = max(MIN_CONTRAST, float(np.percentile(change, CONTRAST_PERCENTILE)) if len(change) else 0.0)
    return first[change > least], second[change > least]


def _same_surface(pairs: Array, range_: Array) -> Array:
    first, second = range_[pairs].T
    return np.asarray(np.abs(first - second) < SAME_SURFACE * first)


def _spacing(xyz: Array, range_: Array, across: Array, ring: Array) -> Array:
    """Angle (rings,) [rad] between each ring and the one below, by points of both on one surface; inf if unknown."""
    elevation = np.arcsin(xyz[:, 2] / np.maximum(range_, 1e-3))
    upper, lower = across[_same_surface(across, range_)].T
    spacing = np.full(int(ring.max(initial=-1)) + 1, np.inf)
    for number in np.unique(ring[upper]):
        of_ring = ring[upper] == number
        spacing[number] = np.median(elevation[upper[of_ring]] - elevation[lower[of_ring]])
    return np.where(spacing > 0, spacing, np.inf)


def _sideways(xyz: Array, turn: Array) -> Array:
    """Steps (E, 3) [m] of points turned about the sensor's axis by `turn` (E,) [rad]."""
    return np.column_stack([-xyz[:, 1] * turn, xyz[:, 0] * turn, np.zeros(len(xyz))])


def _upwards(xyz: Array, angle: Array) -> Array:
    """Steps (E, 3) [m] of points raised by `angle` (E,) [rad]."""
    flat = np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 1e-3)
    return np.column_stack([-xyz[:, :2] * (xyz[:, 2] / flat * angle)[:, None], flat * angle])
