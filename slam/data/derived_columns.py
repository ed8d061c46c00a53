"""Points in other axes or units than ours; their rings and times where only their place in the file tells them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import Block, Content

#: x, y and z in our axes [m], each as the sum of so much x, y and z of the file, and a number.
Axes = tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True)
class PointImage:
    """An image of points without gaps, one column of it after another, as an Ouster sees them.

    Attributes:
        rings: Rows of it, top first.
        columns: Of a turn.
        turn: Seconds of a turn, from the scan's stamp on.
    """

    rings: int
    columns: int
    turn: float


def in_axes(content: Content, axes: Axes) -> Content:
    """The points in our axes, float64."""

    def turned() -> Iterator[Block]:
        for block in content.blocks:
            xyz = [block[axis].astype(np.float64) for axis in "xyz"]
            yield {**block, **{axis: _sum(row, xyz) for axis, row in zip("xyz", axes, strict=True)}}

    return replace(content, blocks=turned())


def _sum(row: tuple[float, ...], xyz: list[Array]) -> Array:
    return np.asarray(sum(factor * values for factor, values in zip(row[:3], xyz, strict=True) if factor) + row[3])


def with_places(content: Content, image: PointImage) -> Content:
    """The points with `ring` and `t` [s] by their place in the image; as they are where the image is not whole."""
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
