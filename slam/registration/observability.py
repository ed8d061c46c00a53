"""Observable directions of a scan: those that enough surface normals face.

In a tunnel every normal is perpendicular to the axis. Estimated normals are slightly tilted, and a thousand tilted
normals give a position along the axis with a sigma of millimetres that is noise only. The tilt of a normal is bounded
by the thickness, width and number of points of its surface; a surface that faces a direction within this bound is not
counted. (Zhang, Kaess, Singh, ICRA 2016, threshold the eigenvalues of all surfaces, with a limit for each environment.)
"""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.registration.voxels import VoxelGaussians

MIN_SHARE = 0.0012  # of the surfaces; below it a direction is unobservable. In a tunnel 0.0003, elsewhere 0.002 or more
REOBSERVED_SHARE = 0.002  # from which a direction that was unobservable is observable again
SAME_DIRECTION = 0.9  # cosine above which the directions of two scans are the same


def unobserved(cells: VoxelGaussians, xyz: Array, weight: Array, pose: Array, kernel: float, before: Array) -> Array:
    """Return the directions along which a scan does not constrain its position.

    Args:
        cells: The map; its Gaussians have surface information.
        xyz: Points (N, 3) float32 in the sensor's axes, with weights (N,) float32.
        weight: See `xyz`.
        pose: Pose (4, 4) of the scan in the map.
        kernel: Scale of the robust weights, see `kernels.normal_equations`.
        before: Unobservable directions (K, 3) of the last scan, in the axes of the map.

    Returns:
        Unit vectors (K, 3) in the axes of the map, at most two: a registered scan constrains one direction at least.
    """
    normals, rows, counted = cells.support(xyz, weight, pose, kernel)
    axes = np.ascontiguousarray(np.linalg.eigh(normals)[1].T[:2])  # rows, the weakest first
    shares = cells.facing(rows, counted, axes)
    known = (np.abs(axes @ before.T) > SAME_DIRECTION).any(axis=1)
    return np.asarray(axes[shares < np.where(known, REOBSERVED_SHARE, MIN_SHARE)])
