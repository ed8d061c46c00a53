"""Conversion of points from other axes and units; rings and times that follow from the position in the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import Block, Content

#: x, y and z in our axes [m], each a sum of multiples of the file's x, y and z, and a constant.
Axes = tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True)
class PointImage:
    """An image of points without gaps, stored column by column, as an Ouster records them.

    Attributes:
        rings: Number of rows, top first.
        columns: Number of columns in a turn.
        turn: Duration of a turn [s], which begins at the scan's stamp.
    """

    rings: int
    columns: int
    turn: float


def in_axes(content: Content, axes: Axes) -> Content:
    """Convert points to our axes, float64."""

    def turned() -> Iterator[Block]:
        for block in content.blocks:
            xyz = [block[axis].astype(np.float64) for axis in "xyz"]
            yield {**block, **{axis: _sum(row, xyz) for axis, row in zip("xyz", axes, strict=True)}}

    return replace(content, blocks=turned())


def _sum(row: tuple[float, ...], xyz: list[Array]) -> Array:
    return np.asarray(sum(factor * values for factor, values in zip(row[:3], xyz, strict=True) if factor) + row[3])


def with_places(content: Content, image: PointImage) -> Content:
    """Add `ring` and `t` [s] by the position in the image; return the points unchanged if the image is incomplete."""
    if content.count != image.rings * image.columns:
        return content

    def placed() -> Iterator[Block]:
        first = 0
        for block in content.blocks:
            place = first + np.arange(len(block["x"]))
            time = (place // image.rings * (image.turn / image.columns)).astype(np.float32)
            yield {**block, "ring": (place % image.rings).astype(np.int16), "t": time}
            first += len(place)

    return replace(content, names=[*content.names, "ring", "t"], blocks=placed())
