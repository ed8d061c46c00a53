"""Global map of the static points of all keyframes."""

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

CARVING_RANGE = 40.0  # m: farther beams are too far apart, and displaced too much by small rotation errors
MARGIN, SHARE = 0.4, 0.04  # m, and share of the distance: a return less far behind a voxel may be of the voxel itself
MIN_PASSES, PASSES_PER_HIT = 2, 2  # an empty voxel: scans that saw through it, and their minimum ratio to hits
TILE = 10.0  # m: side of the square tiles that index the voxels


def build_map(keyframes: Sequence[Keyframe], poses: Array, settings: MapSettings | None = None) -> PointCloud:
    """Build the map from keyframes at their optimised poses (N, 4, 4), without moving objects, in the world frame.

    The keyframes are read twice, one at a time, so the memory depends on the size of the map, not on their number.
    """
    world = GlobalMap(settings or MapSettings())
    for keyframe, pose in zip(keyframes, poses, strict=True):
        world.insert(keyframe.cloud, pose)
    world.carve((keyframe.view, pose) for keyframe, pose in zip(keyframes, poses, strict=True))
    return world.points()


class GlobalMap(VoxelAverages):
    """Map with one averaged point per voxel."""

    def __init__(self, settings: MapSettings) -> None:
        super().__init__(settings.voxel_size, settings.min_range, settings.max_range)
        self._passes = np.zeros(0, np.uint16)

    def clear(self) -> None:
        """Remove all points; the memory is kept."""
        super().clear()
        self._passes = np.zeros(0, np.uint16)

    def carve(self, views: Iterable[tuple[RangeImage, Array]]) -> None:
        """Mark moving objects, so that `points` leaves them out: voxels that beams of other scans passed through.

        A voxel is empty if at least MIN_PASSES scans saw through it, and more than PASSES_PER_HIT times as many as have
        a point in it. Poles, fences and leaves, which some beams miss, have too many hits for that.

        Args:
            views: Range images of scans with their poses T_world_lidar (4, 4).
        """
        tiles = _Tiles(self._keys[: self._count], self.size)
        xyz, passes = kernels.means(self._sums, self._keys, tiles.order, self.size), np.zeros(self._count, np.uint16)
        for view, pose in views:
            kernels.pass_through(
                view.passed(), view.first_row, SPHERE_ROWS, se3.inverse(pose), CARVING_RANGE, MARGIN, SHARE,
                xyz, *tiles.around(pose[:2, 3], CARVING_RANGE), passes,
            )  # fmt: skip
        self._passes = np.empty_like(passes)
        self._passes[tiles.order] = passes

    def points(self) -> PointCloud:
        """Return the map so far, in the world frame, without voxels that `carve` found empty."""
        empty = np.zeros(self._count, bool)
        passes = self._passes.astype(np.int64)
        empty[: len(passes)] = (passes >= MIN_PASSES) & (
            passes > PASSES_PER_HIT * self._sums[: len(passes), kernels.SEEN]
        )
        return self._points(~empty)


class _Tiles:
    """Index of voxels by square tiles in the x-y plane.

    Attributes:
        order: (C,) int64, all voxels, sorted by tile.
    """

    def __init__(self, keys: Array, size: float) -> None:
        voxels = max(1, round(TILE / size))
        self._width = voxels * size
        number = _number(*kernels.tiles(keys, voxels).T)
        self.order = np.argsort(number, kind="stable")
        self._numbers, self._starts = np.unique(number[self.order], return_index=True)
        self._stops = np.append(self._starts[1:], len(keys))

    def around(self, place: Array, radius: float) -> tuple[Array, Array]:
        """First and last + 1 in `order` of each tile within `radius` [m] of a place (2,)."""
        low, high = (np.floor((place + offset) / self._width) for offset in (-radius, radius))
        x, y = (np.arange(low[axis], high[axis] + 1) for axis in (0, 1))
        found = np.flatnonzero(np.isin(self._numbers, _number(x[:, None], y)))
        return self._starts[found], self._stops[found]


def _number(x: Array, y: Array) -> Array:
    """A single number for the indices of a tile."""
    return np.asarray((x.astype(np.int64) << 32) + y.astype(np.int64))
