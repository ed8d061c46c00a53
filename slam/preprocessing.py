"""Preprocessing of scans for the odometry: downsample, weigh, and correct by a velocity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slam.cell_sizes import Sizes, choose_sizes
from slam.consistency import Sample, sample
from slam.data.cloud import Array, PointCloud
from slam.data.distortion import Correction
from slam.registration.target import Points
from slam.registration.voxels import VoxelFilter
from slam.settings import OdometrySettings

MAX_POINTS = 40_000  # of a downsampled scan for registration; more: points all over the place
FEW_POINTS = 500  # of one, as on narrow stairs, where a dozen then decide the height; fewer: the map's are registered
MIN_POINTS = 50  # of a downsampled scan for registration; fewer: an empty or almost empty file
NO_POINTS: Points = (np.zeros((0, 3), np.float32), np.zeros(0, np.float32))


class Prepared(NamedTuple):
    """A scan ready for registration.

    Attributes:
        scan: The scan as recorded, and its correction.
        sample: Some of its points.
        map_points: Its points for the map.
        points: Its points for registration, N.
        time: Their times (N,) [s] from the middle of the sweep; None without times.
    """

    scan: tuple[PointCloud, Correction]
    sample: Sample
    map_points: Points
    points: Points
    time: Array | None


class Preprocessing:
    """Prepares scans, with sizes chosen from the first one that has points.

    Args:
        settings: Settings of the odometry.
        vertical_correction: Angle [rad] added to each elevation.

    Attributes:
        sizes: Cell and voxel sizes, None before the first scan.
    """

    def __init__(self, settings: OdometrySettings, vertical_correction: float) -> None:
        self.settings, self.vertical_correction = settings, vertical_correction
        self.sizes: Sizes | None = None

    def __call__(self, cloud: PointCloud, velocity: Array) -> Prepared:
        """Prepare a scan as recorded, deskewed by a velocity (6,) [rad/s, m/s] in the sensor's axes."""
        correction = Correction(velocity, self.vertical_correction)
        some = sample(cloud, correction)
        if self.sizes is None and len(cloud) >= MIN_POINTS:
            self._initialise(cloud)
        if self.sizes is None:
            return Prepared((cloud, correction), some, NO_POINTS, NO_POINTS, None)
        xyz, weight, time = self._map_filter(cloud.xyz, self._weights(cloud), cloud.time)
        map_points = correction.points(xyz, None if cloud.time is None else time), weight
        thinned = self._registration_filter(*map_points, time)
        if len(thinned[0]) < FEW_POINTS and self.settings.voxel_size is None:
            thinned = (*map_points, time)
        xyz, weight, time = (values[:: max(1, len(values) // MAX_POINTS)] for values in thinned)
        return Prepared((cloud, correction), some, map_points, (xyz, weight), None if cloud.time is None else time)

    def _initialise(self, scan: PointCloud) -> None:
        """Choose the sizes from the first scan."""
        self.sizes = sizes = choose_sizes(self.settings, scan.xyz)
        self._map_filter = VoxelFilter(sizes.map_voxel_size, sizes.min_range, self.settings.max_range)
        self._registration_filter = VoxelFilter(sizes.voxel_size)

    def _weights(self, scan: PointCloud) -> Array:
        """Weights (N,) float32: 1 for a sigma up to `full_weight_sigma`, less for a larger range error."""
        full = np.float32(self.settings.full_weight_sigma)
        if not len(scan.sigma) or scan.sigma.max() <= full:  # as of measured points
            return np.ones(len(scan), np.float32)
        return np.asarray((full / np.maximum(scan.sigma, full)) ** 2)
