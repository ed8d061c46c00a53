"""Submaps around keyframes: joined clouds, their Gaussians, and those of recent queries."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.mapping.keyframes import Keyframe
from slam.registration.ndt import NdtTarget
from slam.registration.voxels import VoxelFilter, VoxelGaussians
from slam.settings import VerificationSettings

IDENTITY = np.eye(4)
MAX_ITERATIONS = 12  # of a registration in the finest cells; half of it in coarser ones
NEAR_POINTS = 5000  # within common range, roughly: enough for the shares of points that fit, which count to a percent
PART = 8192  # points that are inserted at once: the table is sized for all of them, and a small one stays in the cache


class Level:
    """Gaussians of a submap in cells of one size.

    Args:
        size: Size of the cells [m].
        xyz: The points of the submap (N, 3) float32.
        sparse: The same points for registration (M, 3) float32.
        max_iterations: Maximum number of iterations of a registration.

    Attributes:
        target: The target of a registration.
    """

    def __init__(self, size: float, xyz: Array, sparse: Array, max_iterations: int) -> None:
        self.target = NdtTarget((size,), max_iterations=max_iterations)
        for part in np.array_split(xyz, len(xyz) // PART + 1):
            self.target.insert(part, ones(part), IDENTITY)
        self.cells.compact()
        self._own_score = self.scores(sparse, IDENTITY[None])[0]

    @property
    def cells(self) -> VoxelGaussians:
        """The cells."""
        return self.target.levels[0]

    def scores(self, xyz: Array, poses: Array) -> Array:
        """Return the paper's eq. 5, divided by the number of points, for points (N, 3) at poses (P, 4, 4)."""
        return np.asarray(self.cells.fits(xyz, poses)[:, 0] / max(len(xyz), 1))

    def similarity(self, xyz: Array, pose: Array) -> float:
        """Return the score of points (N, 3) at a pose (4, 4), relative to that of the submap's own points."""
        return float(self.scores(xyz, pose[None])[0] / max(self._own_score, 1e-9))

    def inlier_ratios(self, xyz: Array, poses: Array) -> Array:
        """Return the shares (P,) of points (N, 3) at poses (P, 4, 4) that fit the Gaussian of their cell."""
        return np.asarray(self.cells.fits(xyz, poses)[:, 1] / max(len(xyz), 1))


class Submap:
    """Downsampled points around a keyframe, in its frame, with their Gaussians.

    Args:
        xyz: Points (N, 3) float32.
        thin: Filter that downsamples them for registration.
        settings: Settings.

    Attributes:
        xyz: The points.
        sparse: The points for registration (M, 3) float32.
    """

    def __init__(self, xyz: Array, thin: VoxelFilter, settings: VerificationSettings) -> None:
        self.xyz, self.sparse = xyz, thin(xyz, ones(xyz))[0]
        self._range, self._sizes = settings.common_range, settings.cell_sizes
        self._levels: dict[int, Level] = {}

    def __len__(self) -> int:
        return len(self.xyz)

    @cached_property
    def near(self) -> Array:
        """Every `near_step`-th point within common range of the keyframe's sensor (K, 3) float32."""
        return np.ascontiguousarray(self._within[:: self.near_step])

    @property
    def near_step(self) -> int:
        """Number of points that each of `near` stands for."""
        return len(self._within) // NEAR_POINTS + 1

    @cached_property
    def _within(self) -> Array:
        return self.xyz[squared_norms(self.xyz) < self._range**2]

    @property
    def levels(self) -> int:
        """Number of levels of cells."""
        return len(self._sizes)

    def level(self, number: int) -> Level:
        """Return a level of cells: 0 the coarsest, -1 the finest."""
        number %= self.levels
        if number not in self._levels:
            limit = MAX_ITERATIONS if number == self.levels - 1 else MAX_ITERATIONS // 2
            self._levels[number] = Level(self._sizes[number], self.xyz, self.sparse, limit)
        return self._levels[number]

    def forget_fine_levels(self) -> None:
        """Keep the coarsest level only: nearly all queries end there, and it takes a tenth of the memory."""
        self._levels = {number: level for number, level in self._levels.items() if number == 0}


class Submaps:
    """Submaps around keyframes of one run; the recent ones are kept.

    Args:
        settings: Settings.
        radius: Travelled distance [m] before and after the central keyframe.
        kept: Number of submaps that are kept.
    """

    def __init__(self, settings: VerificationSettings, radius: float, kept: int) -> None:
        self._settings, self._radius, self._most = settings, radius, kept
        self._thin, self._thin_more = (
            VoxelFilter(size) for size in (settings.voxel_size, settings.registration_voxel_size)
        )
        self._kept: OrderedDict[int, Submap] = OrderedDict()

    def around(self, keyframes: Sequence[Keyframe], centre: int) -> Submap:
        """Return the submap around a keyframe, by its position in the run.

        Args:
            keyframes: All keyframes so far. A submap to which later ones might be added is not kept.
            centre: Position of the central keyframe.
        """
        if centre in self._kept:
            self._kept.move_to_end(centre)
            return self._kept[centre]
        xyz = submap(keyframes, centre, self._radius, self._settings.max_points)
        found = Submap(self._thin(xyz, ones(xyz))[0], self._thin_more, self._settings)
        if keyframes[-1].travelled > keyframes[centre].travelled + self._radius:
            self._kept[centre] = found
            if len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return found


def submap(keyframes: Sequence[Keyframe], centre: int, radius: float, max_points: int) -> Array:
    """Join the clouds of keyframes around a centre, by their odometry poses: drift is negligible over this distance.

    Args:
        keyframes: All keyframes.
        centre: Position of the central keyframe.
        radius: Travelled distance [m] before and after the centre.
        max_points: Maximum number of points per keyframe; larger clouds are reduced to every second, third ... point.

    Returns:
        Points (N, 3) float32 in the frame of the central keyframe.
    """
    here = keyframes[centre]
    T_here_world = se3.inverse(here.pose)
    clouds = []
    for keyframe in [here, *_neighbours(keyframes, centre, here.travelled, radius)]:
        T = (T_here_world @ keyframe.pose).astype(np.float32)
        xyz = keyframe.cloud.xyz[:: len(keyframe.cloud) // max_points + 1]
        clouds.append(xyz @ T[:3, :3].T + T[:3, 3])
    return np.concatenate(clouds)


def ones(xyz: Array) -> Array:
    """Return weights (N,) float32 of one for points (N, 3)."""
    return np.ones(len(xyz), np.float32)


def squared_norms(xyz: Array) -> Array:
    """Return the squared distances (N,) of points (N, 3) from the origin."""
    return np.asarray(np.einsum("ij,ij->i", xyz, xyz))


def _neighbours(keyframes: Sequence[Keyframe], centre: int, travelled: float, radius: float) -> list[Keyframe]:
    """Keyframes before and after the centre; each is fetched once, since its cloud may be on disk."""
    found = []
    for positions in (range(centre - 1, -1, -1), range(centre + 1, len(keyframes))):
        for position in positions:
            keyframe = keyframes[position]
            if abs(keyframe.travelled - travelled) > radius:
                break
            found.append(keyframe)
    return found
