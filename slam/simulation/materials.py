"""Materials of surfaces: their properties for LiDAR and camera."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from slam.data.cloud import Array


class Pattern(IntEnum):
    """Texture of a surface."""

    PLAIN = 0
    SPECKLE = 1  # fine grain: asphalt, plaster, bark
    BLOTCHES = 2  # patches of a metre and of ten centimetres: grass, leaves, worn paint
    BRICKS = 3
    TILES = 4  # paving stones, roof tiles


class Material(NamedTuple):
    """Material of a surface.

    Attributes:
        name: Name used by the parts of a scene.
        colour: Default albedo, RGB 0..255.
        reflectance: Reflectance of a LiDAR pulse at normal incidence, 0..1, as in KITTI's fourth column.
        retroreflect: Share of the reflectance that is independent of incidence (signs, plates, road paint).
        lost: Share of the pulses without an echo: through glass, off dark paint, between leaves.
        gloss: Share of the sky that the camera sees mirrored.
        pattern: Texture for the camera.
        contrast: Contrast of the texture, 0..1.
    """

    name: str
    colour: tuple[int, int, int]
    reflectance: float
    retroreflect: float = 0.0
    lost: float = 0.0
    gloss: float = 0.0
    pattern: Pattern = Pattern.SPECKLE
    contrast: float = 0.15


MATERIALS = (
    Material("asphalt", (92, 92, 95), 0.27, contrast=0.22),
    Material("marking", (215, 215, 208), 0.55, retroreflect=0.5, contrast=0.12),
    Material("kerb", (150, 148, 142), 0.35, contrast=0.2),
    Material("paving", (142, 138, 130), 0.33, pattern=Pattern.TILES, contrast=0.25),
    Material("grass", (94, 104, 62), 0.42, lost=0.02, pattern=Pattern.BLOTCHES, contrast=0.4),
    Material("soil", (120, 100, 78), 0.32, pattern=Pattern.BLOTCHES, contrast=0.3),
    Material("plaster", (205, 192, 168), 0.42, contrast=0.08),
    Material("brick", (150, 88, 70), 0.33, pattern=Pattern.BRICKS, contrast=0.35),
    Material("concrete", (158, 156, 150), 0.36, pattern=Pattern.BLOTCHES, contrast=0.15),
    Material("roof", (128, 70, 56), 0.25, pattern=Pattern.TILES, contrast=0.3),
    Material("glass", (60, 74, 88), 0.12, lost=0.5, gloss=0.55, pattern=Pattern.PLAIN),
    Material("wood", (112, 82, 56), 0.34, contrast=0.3),
    Material("bark", (84, 68, 54), 0.28, contrast=0.4),
    Material("leaves", (66, 98, 44), 0.38, lost=0.03, pattern=Pattern.BLOTCHES, contrast=0.45),
    Material("metal", (140, 142, 145), 0.38, lost=0.05, gloss=0.1, pattern=Pattern.PLAIN),
    Material("sign", (220, 220, 220), 0.95, retroreflect=0.95, pattern=Pattern.PLAIN),
    Material("car_paint", (150, 155, 160), 0.30, lost=0.05, gloss=0.22, pattern=Pattern.PLAIN),
    Material("tyre", (32, 32, 34), 0.10, lost=0.15, contrast=0.2),
    Material("plate", (225, 225, 220), 0.90, retroreflect=0.9, pattern=Pattern.PLAIN),
    Material("parquet", (150, 112, 74), 0.36, pattern=Pattern.TILES, contrast=0.3),
    Material("carpet", (92, 98, 112), 0.30, lost=0.01, pattern=Pattern.BLOTCHES, contrast=0.3),
    Material("linoleum", (150, 146, 132), 0.33, pattern=Pattern.BLOTCHES, contrast=0.18),
    Material("wallpaper", (206, 196, 176), 0.42, pattern=Pattern.BLOTCHES, contrast=0.14),
    Material("ceiling", (226, 226, 222), 0.60, pattern=Pattern.TILES, contrast=0.1),
    Material("laminate", (222, 220, 212), 0.45, contrast=0.08),
    Material("fabric", (96, 92, 92), 0.32, lost=0.01, contrast=0.3),
    Material("paper", (220, 216, 206), 0.55, contrast=0.25),
    Material("screen", (20, 22, 26), 0.06, lost=0.3, gloss=0.3, pattern=Pattern.PLAIN),
    Material("pane", (236, 243, 250), 0.12, lost=0.5, pattern=Pattern.BLOTCHES, contrast=0.1),  # seen against daylight
    Material("lamp", (255, 255, 250), 0.50, pattern=Pattern.PLAIN),
)

#: Index of a material by its name.
INDEX = {material.name: index for index, material in enumerate(MATERIALS)}

#: Default colours (M, 3) uint8, in the order of MATERIALS.
COLOURS: Array = np.array([material.colour for material in MATERIALS], np.uint8)
