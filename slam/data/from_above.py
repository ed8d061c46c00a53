"""Order in which points are drawn from above."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array

STEP = 0.01  # m: heights that differ less are one height


def highest_last(z: Array) -> Array:
    """Return the order (N,) of heights (N,) [m] from the lowest to the highest, in steps of a centimetre.

    A pixel that is painted in this order shows its highest point. Whole numbers of 16 bits are sorted ten times faster
    than floats; heights beyond 327 m above or below the middle count as equal.
    """
    middle = np.float32((z.min() + z.max()) / 2) if len(z) else np.float32(0)
    steps = np.clip((z - middle) * np.float32(1 / STEP), -32768, 32767).astype(np.int16)
    return np.argsort(steps, kind="stable")
