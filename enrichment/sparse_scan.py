"""What a method of enrichment is given: a scan of few rings, and the image beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enrichment.rays import Prediction, RayGrid
from slam.data.cloud import Array, Calibration, PointCloud
from slam.data.sensor import Sensor


@dataclass(frozen=True, eq=False)
class SparseScan:
    """A scan as recorded, in the sensor's own geometry: neither deskewed nor vertically corrected.

    cloud        with ring ids
    lines        the laser line of every ring id
    rings        (K,) the ids that its sensor has, top first: a ring without any return counts, a dropped one does not
    image        (H, W, 3) uint8 RGB of the same moment, or None
    calibration  the camera's, or None
    """

    cloud: PointCloud
    lines: Sensor
    rings: Array
    image: Array | None = None
    calibration: Calibration | None = None

    def without(self, rings: Array) -> SparseScan:
        """The same scan as a sensor without these rings (M,) would have seen it."""
        assert self.cloud.ring is not None
        cloud = self.cloud.select(~np.isin(self.cloud.ring, rings))
        kept = self.rings[~np.isin(self.rings, rings)]
        return SparseScan(cloud, self.lines, kept, self.image, self.calibration)


class Method(Protocol):
    """Predicts ranges on the rays of a grid from a sparse scan. Rays on rings that the scan has may be left out."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction: ...
