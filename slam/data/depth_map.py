"""Depth maps as KITTI stores them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError

DEPTH_SCALE = 256.0  # steps a metre, in 16 bits


def read_depth_map(path: Path) -> Array:
    """(H, W) float32, metres, 0 where there is no value, from a PNG of 16 bits. Raises InputError on anything else."""
    import cv2  # takes a while to import

    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.is_file() else None
    if values is None or values.dtype != np.uint16 or values.ndim != 2:
        fault = "no such file" if not path.exists() else "not a grey PNG of 16 bits"
        raise InputError(f"{path}: {fault}; a depth map is needed, {DEPTH_SCALE:g} steps a metre, 0 = no value")
    return np.asarray(values / np.float32(DEPTH_SCALE))
