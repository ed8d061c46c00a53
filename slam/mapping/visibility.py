"""Range image of a scan: the space that its beams passed through is empty."""

from __future__ import annotations

from dataclasses import dataclass

from slam.data.cloud import Array, PointCloud
from slam.mapping import kernels

#: Size of a range image of the whole sphere: bins of half a degree, about the ring spacing of a 64-channel LiDAR.
SPHERE_ROWS, SPHERE_COLUMNS = 360, 720
GAP = 5  # maximum rows between a bin and the next return above or below: 16-channel rings are 2 deg apart


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Nearest returns of one scan by direction.

    Attributes:
        first_row: First row with a return, of the rows from straight up to straight down.
        nearest: (R, SPHERE_COLUMNS) uint16, range of the nearest return in each bin [cm], 0 without a return.
    """

    first_row: int
    nearest: Array

    @staticmethod
    def of(cloud: PointCloud) -> RangeImage:
        """Build the range image from the measured points; predicted points are no beams."""
        image = kernels.range_image(cloud.xyz, cloud.measured, SPHERE_ROWS, SPHERE_COLUMNS)
        filled = image.any(axis=1).nonzero()[0]
        if len(filled) == 0:
            return RangeImage(0, image[:0])
        return RangeImage(int(filled[0]), image[filled[0] : filled[-1] + 1].copy())

    def passed(self) -> Array:
        """Return the range up to which space is certainly empty, (R, SPHERE_COLUMNS) float32 [m], 0 where unknown.

        This is the nearest return of a bin and the bins around it, so that neither a road at a grazing angle, which the
        next beam hits metres farther, nor a pole that some beams miss is empty. Between two rings, both must see far.
        """
        return kernels.nearest_around(self.nearest, GAP)
