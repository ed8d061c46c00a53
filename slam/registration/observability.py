"""Which directions a scan holds: those that its surfaces face more than their own noise explains.

In a tunnel every normal points across it. Estimated normals tilt by a little, and a tilted normal seems to hold the
axis: a thousand of them state a position along it with a sigma of millimetres that is all noise. How much they tilt is
known from each surface's thickness, width and number of points, and what a direction has by that alone holds nothing.
(Zhang, Kaess, Singh, ICRA 2016, judge by the eigenvalues alone, against a limit for each environment.)
"""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array

NOISE = 1.25  # times the normals' tilt: what a direction has by noise. Inside the tunnel 0.2 to 1.2, else 1.5 and more
CLEAR = 3.0  # times the tilt before a direction that was not held counts as held again
SAME = 0.9  # cosine between directions that are one, from scan to scan


def unobserved(support: Array, tilt: float, before: Array) -> Array:
    """Directions along which a scan does not hold its position.

    Args:
        support: (3, 3) mean of n n^T over the matched points, see `kernels.support`.
        tilt: Mean variance of the normals' tilt [rad^2].
        before: (K, 3) directions that the last scan did not hold, in the same axes.

    Returns:
        (K, 3) unit vectors in the axes of `support`, none or at most two: a scan that matches holds something.
    """
    shares, vectors = np.linalg.eigh(support)
    lost = [
        vector
        for share, vector in zip(shares[:2], vectors.T[:2], strict=True)
        if share < (CLEAR if (np.abs(before @ vector) > SAME).any() else NOISE) * tilt
    ]
    return np.array(lost).reshape(-1, 3)
