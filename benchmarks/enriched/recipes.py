"""Fixed settings for registering plain 16 channels; enriched input is compared with the best of them on each drive.

Written down before the enrichment was tuned, and not changed since.
"""

from __future__ import annotations

from typing import Any

#: The defaults for 64 channels, as they were then.
DENSE: dict[str, Any] = {
    "information_matrix": "covariance", "cell_sizes": (2.0, 1.0), "voxel_size": 1.5, "map_voxel_size": 0.4,
    "min_range": 2.5, "full_weight_sigma": 0.3,
}  # fmt: skip
SIXTEEN: dict[str, dict[str, Any]] = {
    # the preset for 16, as it was then
    "channels-16": {**DENSE, "voxel_size": 0.5, "min_points": 3, "regularisation": 0.01},
    "as for 64": DENSE,
    "larger cells": {**DENSE, "voxel_size": 1.0, "min_points": 3, "regularisation": 0.003, "cell_sizes": (3.0, 1.5)},
}
