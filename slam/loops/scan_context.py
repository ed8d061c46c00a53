"""Scan context: places recognised by how high the surroundings reach around them.

A descriptor holds the highest point of each cell of a polar grid about the sensor: rings x sectors (Kim and Kim, "Scan
Context", IROS 2018). A turn of the sensor shifts its columns, so a place is found again from any heading, and the shift
tells the yaw. A pass on another lane is found through virtual sensors moved sideways (root-shift augmentation; Kim,
Choi and Kim, "Scan Context++", T-RO 2021).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from slam.data import se3
from slam.data.cloud import Array
from slam.loops import kernels
from slam.settings import ScanContextSettings


@dataclass(frozen=True)
class Candidate:
    """A place that looks like the one asked about: nothing is verified yet.

    index          number of the place, in the order in which they were added, from 0
    distance       scan context distance, 0 (alike) to 1
    yaw            [rad], -pi to pi: heading of the query in the candidate's frame, to half a sector
    lateral_shift  [m] to the left of the query, where the candidate's path passes
    """

    index: int
    distance: float
    yaw: float
    lateral_shift: float

    @property
    def relative_pose(self) -> Array:
        """T_candidate_query (4, 4), a first guess from yaw and lateral shift; along the way it can be metres off."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        T = np.eye(4)
        T[:2, :2] = [[cos, -sin], [sin, cos]]
        T[:2, 3] = sin * self.lateral_shift, -cos * self.lateral_shift
        return T


DEFAULT = ScanContextSettings()

RENEWAL = 100  # places added until the tree is built anew; up to then they are looked through one by one


def descriptor(xyz: Array, settings: ScanContextSettings = DEFAULT) -> Array:
    """Points (N, 3) in the sensor's frame, z up -> (rings, sectors) float32: height above the ground [m], 0 = empty."""
    return _descriptors(xyz, (0.0,), settings)[0]


def ring_key(descriptor: Array) -> Array:
    """Means of the rings, (..., rings, sectors) -> (..., rings): the same whatever the yaw."""
    return np.asarray(descriptor.mean(axis=-1))


def distance(a: Array, b: Array) -> tuple[float, float]:
    """How unlike two descriptors are, 0 to 1, and the yaw [rad] of a in b's frame at which they are most alike.

    1 - mean cosine of the columns that are not empty in both, the least over all column shifts (eq. 6 and 7 of the
    paper); 1 where there are no such columns.
    """
    distances, shifts = kernels.align(*_twice(a[None]), *_columns(b[None]), np.zeros(1, np.int64))
    return float(distances[0, 0]), float(_yaw(shifts[0, 0], a.shape[1]))


def levelled_submap(clouds: Sequence[Array], poses: Array, travelled: Array, length: float) -> Array:
    """One cloud (N, 3) float32 of the last keyframe and those at most `length` [m] of way before it.

    clouds  (Nk, 3) float32, each in its keyframe's frame;  poses  (K, 4, 4) T_world_lidar;  travelled  (K,) [m]
    It stands in the last keyframe's `levelled` frame: what a tilt lifts ahead, it would lower on the way back.
    """
    first = int(np.searchsorted(travelled, travelled[-1] - length))
    T_level_lidar = (se3.inverse(levelled(poses[-1])) @ poses[first:]).astype(np.float32)
    return np.concatenate([clouds[first + k] @ T[:3, :3].T + T[:3, 3] for k, T in enumerate(T_level_lidar)])


def levelled(pose: Array) -> Array:
    """The pose (4, 4) with its position and heading, without roll and pitch: the frame of `submap`."""
    yaw = np.arctan2(pose[1, 0], pose[0, 0])
    result = se3.exp(np.array([0.0, 0.0, yaw, 0.0, 0.0, 0.0]))
    result[:3, 3] = pose[:3, 3]
    return result


class ScanContext:
    """The places passed so far. `query` before `add`, keyframe by keyframe, with the same cloud:

    >>> places = ScanContext()
    >>> loops = places.query(xyz, travelled)  # most alike first
    >>> places.add(xyz, travelled)  # 0, 1, 2 ...: the index that later candidates carry

    `travelled` [m] is the way from the start to the keyframe; it never falls.
    """

    def __init__(self, settings: ScanContextSettings = DEFAULT) -> None:
        self.settings = settings
        self._count = 0
        self._travelled = np.zeros(64)
        self._keys = np.zeros((64, settings.rings), np.float32)
        self._columns = np.zeros((64, settings.sectors, settings.rings), np.float32)
        self._filled = np.zeros((64, settings.sectors), np.float32)
        self._tree = cKDTree(self._keys[:0])

    def __len__(self) -> int:
        return self._count

    def add(self, xyz: Array, travelled: float) -> int:
        """Remember the place of a cloud (N, 3); its index. Raises ValueError where `travelled` is below the last."""
        if self._count and travelled < self._travelled[self._count - 1]:
            raise ValueError(f"travelled: {travelled} m after {self._travelled[self._count - 1]} m; it never falls")
        if self._count == len(self._travelled):
            for name in ("_travelled", "_keys", "_columns", "_filled"):
                values = getattr(self, name)
                setattr(self, name, np.concatenate([values, np.zeros_like(values)]))
        row, context = self._count, descriptor(xyz, self.settings)
        self._travelled[row], self._keys[row] = travelled, ring_key(context)
        self._columns[row], self._filled[row] = (values[0] for values in _columns(context[None]))
        self._count += 1
        return row

    def query(self, xyz: Array, travelled: float, exhaustive: bool = False) -> list[Candidate]:
        """Places like that of the cloud (N, 3), at least `min_travelled` before `travelled` [m]; most alike first.

        `exhaustive` compares all of them at all shifts instead of those with the nearest ring keys: the reference.
        Of the shifts of one place only the best is kept; equals come in the order in which they were added.
        """
        contexts = _descriptors(xyz, self.settings.lateral_shifts, self.settings)
        end = int(np.searchsorted(self._travelled[: self._count], travelled - self.settings.min_travelled, "right"))
        rows = np.arange(end) if exhaustive else self._preselect(ring_key(contexts), end)
        distances, shifts = kernels.align(*_twice(contexts), self._columns, self._filled, rows)
        if len(rows) == 0:
            return []
        best = distances.argmin(axis=0)
        each = np.arange(len(rows))
        distances, yaws = distances[best, each], _yaw(shifts[best, each], self.settings.sectors)
        return [
            Candidate(int(rows[k]), float(distances[k]), float(yaws[k]), self.settings.lateral_shifts[best[k]])
            for k in np.lexsort((rows, distances))
            if distances[k] < 1.0
        ]

    def _preselect(self, keys: Array, end: int) -> Array:
        """Rows of the places before `end` whose ring keys are nearest to one of `keys` (L, rings), nearest first."""
        if not 0 <= end - self._tree.n < RENEWAL:
            self._tree = cKDTree(self._keys[:end])
        planted, after = self._tree.n, np.arange(self._tree.n, end)
        near, rows = [cdist(keys, self._keys[after])], [np.broadcast_to(after, (len(keys), len(after)))]
        if planted:
            found = self._tree.query(keys, k=range(1, min(self.settings.preselected, planted) + 1))
            near, rows = [*near, found[0]], [*rows, found[1]]
        merged = np.hstack(rows).ravel()
        merged = merged[np.lexsort((merged, np.hstack(near).ravel()))]
        first = np.sort(np.unique(merged, return_index=True)[1])  # of each place, the nearest key
        return np.asarray(merged[first[: self.settings.preselected]])


def _descriptors(xyz: Array, lateral_shifts: Sequence[float], settings: ScanContextSettings) -> Array:
    """(L, rings, sectors), one a virtual sensor `lateral_shifts` [m] to the left."""
    size = (settings.rings, settings.sectors, settings.max_range, settings.sensor_height)
    xyz = np.ascontiguousarray(xyz, np.float32)
    return np.asarray(kernels.describe(xyz, np.array(lateral_shifts, np.float64), *size))


def _columns(contexts: Array) -> tuple[Array, Array]:
    """(L, rings, sectors) -> columns at unit length (L, sectors, rings) and whether they are filled (L, sectors)."""
    columns = np.swapaxes(contexts, 1, 2)
    norms = np.linalg.norm(columns, axis=2, keepdims=True)
    filled = (norms > 0).astype(np.float32)
    return np.ascontiguousarray(columns / np.where(norms > 0, norms, 1), np.float32), filled[:, :, 0]


def _twice(contexts: Array) -> tuple[Array, Array]:
    """`_columns`, all of them twice in a row, as `kernels.align` takes queries."""
    columns, filled = _columns(contexts)
    return np.concatenate([columns, columns], axis=1), np.concatenate([filled, filled], axis=1)


def _yaw(shift: Array, sectors: int) -> Array:
    """Column shift, 0 to sectors - 1 -> [rad], -pi to pi: a turn to the left lowers the columns' numbers."""
    return np.asarray((-shift * 2 * np.pi / sectors + np.pi) % (2 * np.pi) - np.pi)
