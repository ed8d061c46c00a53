"""Colour maps, and colours as numbers."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np

from slam.data.cloud import Array

ColourMap = Literal["viridis", "plasma"]


@cache
def colour_map(name: ColourMap) -> Array:
    """Return the colours (256, 3) uint8 RGB of matplotlib's map of that name, lowest first."""
    import cv2

    code = {"viridis": cv2.COLORMAP_VIRIDIS, "plasma": cv2.COLORMAP_PLASMA}[name]
    return np.asarray(cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], code)[:, 0, ::-1])


def colours_of(values: Array, low: float, high: float, name: ColourMap) -> Array:
    """Return the colours (N, 3) uint8 of values (N,): the first one up to `low`, the last one from `high` on."""
    share = np.clip((np.asarray(values, np.float32) - np.float32(low)) / np.float32(high - low), 0, 1)
    return np.asarray(colour_map(name)[(share * np.float32(255.99)).astype(np.uint8)])


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue of '#RRGGBB', 0 to 255.

    Example:
        >>> rgb("#FF8000")
        (255, 128, 0)
    """
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
