"""Which directions a scan holds: those that enough of its surfaces face.

In a tunnel every normal points across it. Estimated normals tilt by a little, and a thousand tilted ones state a
position along the axis with a sigma of millimetres that is all noise. How far a normal may be tilted is known from its
surface's thickness, width and number of points; a surface that faces a direction no further than that does not count.
(Zhang, Kaess, Singh, ICRA 2016, judge by the eigenvalues of all, against a limit for each environment.)
"""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.registration.voxels import VoxelGaussians

LEAST = 0.0012  # share of what the surfaces face: with less a direction is not held. In a tunnel 0.0003, else 0.002 up
ENOUGH = 0.002  # before a direction that was not held counts as held again
SAME = 0.9  # cosine between directions that are one, from scan to scan


def unobserved(cells: VoxelGaussians, xyz: Array, weight: Array, pose: Array, kernel: float, before: Array) -> Array:
    """Directions along which a scan does not hold its position.

    Args:
        cells: The map; its Gaussians hold by surfaces.
        xyz: Points (N, 3) float32 in the sensor's axes, with weights (N,) float32.
        weight: See `xyz`.
        pose: Of the scan in the map (4, 4).
        kernel: Of the robust weights, see `kernels.normal_equations`.
        before: (K, 3) directions that the last scan did not hold, in the axes of the map.

    Returns:
        (K, 3) unit vectors in the axes of the map, none or at most two: a scan that matches holds something.
    """
    facing, _ = cells.support(xyz, weight, pose, kernel)
    axes = np.ascontiguousarray(np.linalg.eigh(facing)[1].T)  # rows, the weakest first
    _, shares = cells.support(xyz, weight, pose, kernel, axes)
    known = (np.abs(axes @ before.T) > SAME).any(axis=1)
    lost = shares[:2] < np.where(known[:2], ENOUGH, LEAST)
    return np.asarray(axes[:2][lost])
