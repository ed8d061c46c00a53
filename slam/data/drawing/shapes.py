"""Shapes of a drawing. Coordinates are pixels from the left upper corner, x to the right, y downwards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from slam.data.cloud import Array

POINT = 150 / 72  # pixels of a typographic point: drawings have 150 pixels per inch

Dash = Literal["solid", "dash", "dot"]
#: Lengths of a dash and of a gap in widths of the line, without the round ends of the dash.
DASHES: dict[Dash, tuple[float, float]] = {"dash": (2.7, 2.6), "dot": (0.0, 2.6)}


@dataclass(frozen=True)
class Box:
    """An upright rectangle [pixels]."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """Width."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Height."""
        return self.bottom - self.top

    @property
    def corners(self) -> Array:
        """The corners (4, 2), in order."""
        left, top, right, bottom = self.left, self.top, self.right, self.bottom
        return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


@dataclass(frozen=True, eq=False)
class Line:
    """A line with round ends.

    Attributes:
        points: (N, 2); NaN interrupts the line.
        colour: '#RRGGBB'.
        width: Width [pixels].
        dash: Its style.
        opacity: From 0 to 1.
        box: The line is drawn inside this box only.
    """

    points: Array
    colour: str
    width: float = 2.0
    dash: Dash = "solid"
    opacity: float = 1.0
    box: Box | None = None

    def stretches(self) -> Iterator[Array]:
        """Parts (K, 2) of the line between interruptions."""
        known = np.isfinite(self.points).all(axis=1)
        ends = np.flatnonzero(np.diff(known.astype(np.int8))) + 1
        return (part for part in np.split(self.points, ends) if len(part) and np.isfinite(part[0]).all())


@dataclass(frozen=True, eq=False)
class Area:
    """A filled polygon.

    Attributes:
        points: (N, 2).
        colour: '#RRGGBB'.
        opacity: From 0 to 1.
        box: The polygon is drawn inside this box only.
    """

    points: Array
    colour: str
    opacity: float = 1.0
    box: Box | None = None


@dataclass(frozen=True)
class Text:
    """A line of text.

    Attributes:
        x: Horizontal position of the anchor.
        y: Height of the baseline, or of the middle of the letters if `middle`.
        text: The text.
        colour: '#RRGGBB'.
        size: Height of the font [pixels].
        anchor: The part of the text that is at x.
        middle: Whether y is the middle of the letters.
        bold: Whether it is bold.
        upright: Whether it is read from below; x is then the middle of the letters, y the middle of the text.
    """

    x: float
    y: float
    text: str
    colour: str
    size: float = 10 * POINT
    anchor: Literal["start", "middle", "end"] = "start"
    middle: bool = False
    bold: bool = False
    upright: bool = False


@dataclass(frozen=True, eq=False)
class Picture:
    """An image in a box.

    Attributes:
        box: Its place.
        pixels: (H, W, 3) uint8 RGB.
        photograph: Whether it is a photograph; the pixels of others stay sharp, and are kept exactly.
    """

    box: Box
    pixels: Array
    photograph: bool = False


Shape = Line | Area | Text | Picture


@dataclass(frozen=True, eq=False)
class Drawing:
    """Shapes on a ground.

    Attributes:
        width: Width [pixels].
        height: Height [pixels].
        shapes: The shapes, drawn in this order; texts are above all others.
        ground: Colour of the ground, '#RRGGBB'.
    """

    width: int
    height: int
    shapes: list[Shape] = field(default_factory=list)
    ground: str = "#FFFFFF"

    def recoloured(self, ground: str, ink: str, new_ink: str) -> Drawing:
        """Return the drawing on another ground, with what was drawn in the colour `ink` in another one."""
        shapes: list[Shape] = [
            shape if isinstance(shape, Picture) or shape.colour != ink else replace(shape, colour=new_ink)
            for shape in self.shapes
        ]
        return replace(self, shapes=shapes, ground=ground)
