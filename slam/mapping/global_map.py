"""One global map of all that was seen and has stayed where it was."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.mapping import kernels
from slam.mapping.keyframes import Keyframe
from slam.mapping.visibility import SPHERE_ROWS, RangeImage
from slam.mapping.voxel_averages import VoxelAverages
from slam.settings import MapSettings

CARVING_REACH = 40.0  # m: further beams are too far apart, and a small error of a pose moves them too much
MARGIN, SHARE = 0.4, 0.04  # m, and share of the distance: what lies less behind a voxel may be the voxel itself
PASSES, TIMES = 2, 2  # keyframes at least that saw through an empty voxel: more than so many times those that hit it
TILE = 10.0  # m: voxels are looked up by squares of that width


def build_map(keyframes: Sequence[Keyframe], poses: Array, settings: MapSettings | None = None) -> PointCloud:
    """The map from keyframes at their optimised poses (N, 4, 4), without what moved; in the world's frame.

    Goes through the keyframes twice, one at a time: memory follows the size of the map, not their number.
    """
    world = GlobalMap(settings or MapSettings())
    for keyframe, pose in zip(keyframes, poses, strict=True):
        world.insert(keyframe.cloud, pose)
    world.carve((keyframe.view, pose) for keyframe, pose in zip(keyframes, poses, strict=True))
    return world.points()


class GlobalMap(VoxelAverages):
    """A point a voxel, the average of those that fell into it."""

    def __init__(self, settings: MapSettings) -> None:
        super().__init__(settings.voxel_size, settings.min_range, settings.max_range)
        self._passes = np.zeros(0, np.uint16)

    def clear(self) -> None:
        super().clear()
        self._passes = np.zeros(0, np.uint16)

    def carve(self, views: Iterable[tuple[RangeImage, Array]]) -> None:
        """Have what moved left out of `points`: voxels that beams of other scans went through.

        `views`: what scans saw, and from which pose (4, 4), T_world_lidar. A voxel is empty where at least PASSES scans
        saw through it, and more than TIMES as many as there are clouds with a point in it: poles, fences and leaves,
        which some beams miss, are hit too often for that.
        """
        self._passes = np.zeros(self._count, np.uint16)
        tiles = _Tiles(self._keys[: self._count], self.size)
        for view, pose in views:
            kernels.pass_through(
                view.passed(), view.first_row, SPHERE_ROWS, se3.inverse(pose), CARVING_REACH, MARGIN, SHARE,
                tiles.order, *tiles.around(pose[:2, 3], CARVING_REACH), self._keys, self._sums, self.size, self._passes,
            )  # fmt: skip

    def points(self) -> PointCloud:
        """The map so far, in the world's frame, without what `carve` found empty."""
        empty = np.zeros(self._count, bool)
        passes = self._passes.astype(np.int64)
        empty[: len(passes)] = (passes >= PASSES) & (passes > TIMES * self._seen[: len(passes)])
        return self._points(~empty)


class _Tiles:
    """Which voxels lie around a place, seen from above.

    order  (C,) int64: all voxels, tile by tile
    """

    def __init__(self, keys: Array, size: float) -> None:
        voxels = max(1, round(TILE / size))
        self._width = voxels * size
        number = _number(*kernels.tiles(keys, voxels).T)
        self.order = np.argsort(number, kind="stable")
        self._numbers, self._starts = np.unique(number[self.order], return_index=True)
        self._stops = np.append(self._starts[1:], len(keys))

    def around(self, place: Array, radius: float) -> tuple[Array, Array]:
        """First and last + 1 in `order` of each tile that comes within `radius` [m] of a place (2,)."""
        low, high = (np.floor((place + way) / self._width) for way in (-radius, radius))
        x, y = (np.arange(low[axis], high[axis] + 1) for axis in (0, 1))
        found = np.flatnonzero(np.isin(self._numbers, _number(x[:, None], y)))
        return self._starts[found], self._stops[found]


def _number(x: Array, y: Array) -> Array:
    """One number for a tile."""
    return np.asarray((x.astype(np.int64) << 32) + y.astype(np.int64))
