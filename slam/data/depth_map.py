"""Depth maps in KITTI's format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError

DEPTH_SCALE = 256.0  # steps per metre, stored in 16 bits


def read_depth_map(path: Path) -> Array:
    """Read a depth map from a 16-bit PNG.

    Returns:
        Depth (H, W) float32 [m], 0 for no value.

    Raises:
        InputError: The file is missing or not a 16-bit grey PNG.
    """
    import cv2  # takes a while to import

    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.is_file() else None
    if values is None or values.dtype != np.uint16 or values.ndim != 2:
        fault = "no such file" if not path.exists() else "not a 16-bit grey PNG"
        expected = f"a depth map is expected, {DEPTH_SCALE:g} steps per metre, 0 = no value"
        raise InputError(f"{path}: {fault}; {expected}")
    return np.asarray(values / np.float32(DEPTH_SCALE))
