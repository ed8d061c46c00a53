"""How far a scan's beams went in each direction: what they passed on the way is empty."""

from __future__ import annotations

from dataclasses import dataclass

from slam.data.cloud import Array, PointCloud
from slam.mapping import kernels

#: Of the whole sphere: bins of half a degree, about the spacing of a 64-channel LiDAR's rings.
SPHERE_ROWS, SPHERE_COLUMNS = 360, 720
GAP = 5  # rows between a bin and the next return above or below it: a 16-channel LiDAR's rings are 2 deg apart


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Of one scan, seen from its sensor.

    first_row  of the rows from straight up to straight down, the first that has a return
    nearest    (R, SPHERE_COLUMNS) uint16: the nearest return in each bin [cm], 0 where there was none
    """

    first_row: int
    nearest: Array

    @staticmethod
    def of(cloud: PointCloud) -> RangeImage:
        """From the measured points; predicted ones are no beams."""
        image = kernels.range_image(cloud.xyz[cloud.measured], SPHERE_ROWS, SPHERE_COLUMNS)
        filled = image.any(axis=1).nonzero()[0]
        if len(filled) == 0:
            return RangeImage(0, image[:0])
        return RangeImage(int(filled[0]), image[filled[0] : filled[-1] + 1].copy())

    def passed(self) -> Array:
        """(R, SPHERE_COLUMNS) float32 [m]: how far space is empty for certain, 0 where nothing is known.

        The nearest return of a bin and of those around it: a road at a grazing angle is not taken for empty, though the
        next beam hits it metres further on, nor a pole that some beams miss. Between two rings, both must see far.
        """
        return kernels.nearest_around(self.nearest, GAP)
