"""Axes of a chart: scales with their ticks, grid lines, labels and the marks of points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from slam.data.cloud import Array
from slam.data.drawing.colours import ColourMap, colour_map
from slam.data.drawing.fonts import text_width
from slam.data.drawing.shapes import POINT, Area, Box, Line, Picture, Shape, Text
from slam.data.plot_style import GRID, INK

Symbol = Literal["circle", "x", "triangle", "square"]
Ticks = Sequence[tuple[float, str]]  # positions with their labels

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # of ticks, times a power of ten
LOG_STEPS = (1, 2, 5)
GRID_WIDTH = 2  # pixels
LABEL = 10 * POINT  # size of labels
GAP = 10  # pixels between axes and the labels of their ticks
X_TICK, Y_TICK = 120, 38  # pixels between ticks, at least
BAR = 24  # pixels, width of a colour bar


@dataclass(frozen=True)
class Scale:
    """One axis.

    Attributes:
        low: Value at its beginning.
        high: Value at its end, above `low`.
        log: Whether it is logarithmic.
    """

    low: float
    high: float
    log: bool = False

    @staticmethod
    def around(values: Array, margin: float = 0.05, log: bool = False) -> Scale:
        """Return the scale of values with a margin, a share of their extent; NaN is ignored."""
        values = values[np.isfinite(values) & ((values > 0) | (not log))]
        if not len(values):
            return Scale(0.5, 2.0, log) if log else Scale(0.0, 1.0)
        low, high = float(values.min()), float(values.max())
        if log:
            wide = (high / low) ** margin if high > low else 2.0
            return Scale(low / wide, high * wide, log)
        wide = margin * (high - low) or max(margin * abs(high), 1e-3)
        return Scale(low - wide, high + wide)

    def share(self, values: Array) -> Array:
        """Return the positions of values along the axis, from 0 to 1."""
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.asarray(np.log(values / self.low) / math.log(self.high / self.low))
        return np.asarray((values - self.low) / (self.high - self.low))

    def ticks(self, most: float) -> Ticks:
        """Return round values inside the scale, at most about `most`."""
        if self.log:
            return self._powers(most)
        rough = (self.high - self.low) / max(most, 1)
        power = 10.0 ** math.floor(math.log10(rough))
        factor = next(factor for factor in STEPS if factor * power >= 0.999 * rough)
        step, tiny = factor * power, 1e-6 * (self.high - self.low)
        digits = max(0, -math.floor(math.log10(step) + 1e-9) + (factor == 2.5))
        first, last = math.ceil((self.low - tiny) / step), math.floor((self.high + tiny) / step)
        return [(k * step, _number(k * step, digits)) for k in range(first, last + 1)]

    def _powers(self, most: float) -> Ticks:
        decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        found = [step * 10.0**decade for decade in decades for step in LOG_STEPS]
        found = [value for value in found if self.low <= value <= self.high]
        if len(found) > most:
            tens = [10.0**decade for decade in decades if self.low <= 10.0**decade <= self.high]
            found = tens[:: -(-len(tens) // max(int(most), 1))]
        return [(value, f"{value:g}") for value in found]


@dataclass(frozen=True)
class Axes:
    """A pair of axes in a box."""

    box: Box
    x: Scale
    y: Scale

    def at(self, x: Array, y: Array) -> Array:
        """Return the pixels (N, 2) of values (N,)."""
        box = self.box
        return np.column_stack(
            [box.left + self.x.share(np.asarray(x)) * box.width, box.bottom - self.y.share(np.asarray(y)) * box.height]
        )

    def x_ticks(self) -> Ticks:
        """Return as many round values along x as the box has room for."""
        return self.x.ticks(self.box.width / X_TICK)

    def y_ticks(self, sparse: float = 1.0) -> Ticks:
        """Return as many round values along y as the box has room for, divided by `sparse`."""
        return self.y.ticks(self.box.height / (sparse * Y_TICK))

    def grid(self, x: Ticks, y: Ticks, colour: str = GRID, opacity: float = 1.0) -> Line:
        """Return the grid lines at the ticks."""
        xs = np.rint(self.at(np.array([value for value, _ in x]), np.full(len(x), self.y.low))[:, 0])
        ys = np.rint(self.at(np.full(len(y), self.x.low), np.array([value for value, _ in y]))[:, 1])
        box, gap = self.box, [np.nan, np.nan]
        parts = [[[at, box.top], [at, box.bottom], gap] for at in xs]
        parts += [[[box.left, at], [box.right, at], gap] for at in ys]
        return Line(np.array(parts).reshape(-1, 2), colour, GRID_WIDTH if opacity == 1 else 1, opacity=opacity)

    def x_labels(self, ticks: Ticks, title: str = "", size: float = LABEL) -> list[Shape]:
        """Return the labels of the ticks below the axes, and the title below them."""
        at = self.at(np.array([value for value, _ in ticks]), np.full(len(ticks), self.y.low))
        y = self.box.bottom + GAP + 0.8 * size
        labels: list[Shape] = [
            Text(x, y, label, INK, size, "middle") for (x, _), (_, label) in zip(at.tolist(), ticks, strict=True)
        ]
        middle = (self.box.left + self.box.right) / 2
        return [*labels, *([Text(middle, y + 1.5 * LABEL, title, INK, LABEL, "middle")] if title else [])]

    def y_labels(self, ticks: Ticks, title: str = "", title_x: float = 0.0, size: float = LABEL) -> list[Shape]:
        """Return the labels of the ticks on the left of the axes, and the upright title around `title_x`."""
        at = self.at(np.full(len(ticks), self.x.low), np.array([value for value, _ in ticks]))
        labels: list[Shape] = [
            Text(self.box.left - GAP, y, label, INK, size, "end", middle=True)
            for (_, y), (_, label) in zip(at.tolist(), ticks, strict=True)
        ]
        middle = (self.box.top + self.box.bottom) / 2
        return [*labels, *([Text(title_x, middle, title, INK, LABEL, upright=True)] if title else [])]


def labels_width(ticks: Ticks, size: float = LABEL) -> float:
    """Return the width of the longest label [pixels]."""
    return max((text_width(label, size) for _, label in ticks), default=0.0)


def equal_scales(box: Box, x: Scale, y: Scale) -> Axes:
    """Return axes with the same scale in x and y, one of them widened on both sides to fill the box."""
    per_pixel = max((x.high - x.low) / box.width, (y.high - y.low) / box.height)
    return Axes(box, _widened(x, per_pixel * box.width), _widened(y, per_pixel * box.height))


def mark(point: Array, symbol: Symbol, colour: str, size: float = 5 * POINT, box: Box | None = None) -> Shape:
    """Return a symbol of a size [pixels] at a point (2,) [pixels]."""
    radius = size / 2
    if symbol == "x":
        ends = np.array([[-1, -1], [1, 1], [np.nan, np.nan], [-1, 1], [1, -1]])
        return Line(point + radius * ends, colour, 2, box=box)
    if symbol == "circle":
        return Line(point[None], colour, size, box=box)
    corners = {"square": [[-1, -1], [1, -1], [1, 1], [-1, 1]], "triangle": [[0, -1], [1, 1], [-1, 1]]}[symbol]
    return Area(point + radius * np.array(corners), colour, box=box)


def colour_bar(box: Box, name: ColourMap, low: float, high: float, title: str, reverse: bool = False) -> list[Shape]:
    """Return a bar of colours with labels and a title on its right; in `reverse` the brightest colour is lowest."""
    colours = colour_map(name)[:: 1 if reverse else -1]
    axes = Axes(box, Scale(0, 1), Scale(low, high))
    ticks = axes.y.ticks(box.height / (2 * Y_TICK))
    at = axes.at(np.zeros(len(ticks)), np.array([value for value, _ in ticks]))[:, 1].tolist()
    labels = [Text(box.right + GAP, y, label, INK, LABEL, middle=True) for y, (_, label) in zip(at, ticks, strict=True)]
    title_x = box.right + GAP + labels_width(ticks) + LABEL
    middle = (box.top + box.bottom) / 2
    return [Picture(box, colours[:, None]), *labels, Text(title_x, middle, title, INK, LABEL, upright=True)]


def colour_bar_width(low: float, high: float, height: float) -> float:
    """Return the width of a colour bar with its labels and title [pixels]."""
    return BAR + GAP + labels_width(Scale(low, high).ticks(height / (2 * Y_TICK))) + 1.7 * LABEL


def _widened(scale: Scale, extent: float) -> Scale:
    middle = (scale.low + scale.high) / 2
    return Scale(middle - extent / 2, middle + extent / 2)


def _number(value: float, digits: int) -> str:
    """A number with a typographic minus, and without -0."""
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "\N{MINUS SIGN}")
