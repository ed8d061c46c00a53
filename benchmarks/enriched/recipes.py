"""Fixed ways to register plain 16 channels: enriched input is held against the best of them, drive by drive.

Written down before the enrichment was tuned, and not changed since.
"""

from __future__ import annotations

from typing import Any

#: What differs from the defaults for 64 channels.
SIXTEEN: dict[str, dict[str, Any]] = {
    "channels-16": {"voxel_size": 0.5, "min_points": 3, "floor": 0.01},  # the preset, as it was then
    "as for 64": {},
    "larger cells": {"voxel_size": 1.0, "min_points": 3, "floor": 0.003, "cell_sizes": (3.0, 1.5)},
}
