"""Picture of an extrinsic calibration: LiDAR points over an image, before and after."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from slam.data.atomic import written_beside
from slam.data.camera import nearest_pixel, project, visible
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError

NEAREST, FARTHEST = 3.0, 50.0  # m, range of the colours
LABEL_ROWS = 28  # pixels


def overlay(image: Array, xyz: Array, calibration: Calibration, label: str) -> Array:
    """Return an image (H, W, 3) uint8 RGB with the visible points (N, 3) over it, coloured by depth, and a label."""
    pixels, depth = project(xyz, calibration)
    seen = visible(pixels, depth, image.shape)
    column, row = nearest_pixel(pixels[seen])
    share = np.log(depth[seen] / NEAREST) / np.log(FARTHEST / NEAREST)
    values = (255 * np.clip(1 - share, 0, 1)).astype(np.uint8)
    colours = cv2.applyColorMap(values[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1]
    grey = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
    for x, y, colour in zip(column.tolist(), row.tolist(), colours.tolist(), strict=True):
        cv2.circle(grey, (x, y), 1, colour, -1)
    banner = np.zeros((LABEL_ROWS, image.shape[1], 3), np.uint8)
    cv2.putText(banner, label, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (255, 255, 255), 1, cv2.LINE_AA)
    return np.concatenate([banner, grey])


def save_overlays(path: Path, image: Array, xyz: Array, calibrations: Mapping[str, Calibration]) -> None:
    """Write one picture with an overlay per calibration, below each other, each with its label.

    Raises:
        InputError: The file cannot be written.
    """
    stacked = np.concatenate([overlay(image, xyz, each, label) for label, each in calibrations.items()])
    with written_beside(path) as temporary:
        if not cv2.imwrite(str(temporary), stacked[:, :, ::-1]):
            raise InputError(f"{path}: cannot be written; choose another --out")
