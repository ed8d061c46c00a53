"""Charts as drawings, which are written as PNG and SVG files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from eval.report.chart import Chart, Curve, Panel
from slam.data.atomic import write_text
from slam.data.cloud import Array
from slam.data.drawing.axes import GAP, LABEL, Y_TICK, Axes, Scale, Ticks, equal_scales, labels_width, mark
from slam.data.drawing.fonts import text_width
from slam.data.drawing.raster import save_png
from slam.data.drawing.shapes import POINT, Area, Box, Drawing, Line, Shape, Text
from slam.data.drawing.svg import svg
from slam.data.plot_style import INK

WIDTH, PANEL_HEIGHT, PANEL_GAP = 1200, 270, 30  # pixels
FEW_PANELS = 1.6  # as high as so many panels is a chart of one
EDGE = 14  # pixels between the border and what is drawn
TITLE, LEGEND = 12 * POINT, 9 * POINT  # sizes of text
LEGEND_ROW, SAMPLE = 1.45 * LEGEND, 42  # pixels: height of a row, length of a line in it
BAR_GROUP = 0.8  # of the distance between two categories


def save(drawing: Drawing, folder: Path, key: str) -> None:
    """Write a drawing as KEY.png and KEY.svg; text stays text in the SVG.

    Raises:
        InputError: A file cannot be written.
    """
    save_png(drawing, folder / f"{key}.png")
    write_text(folder / f"{key}.svg", svg(drawing))


def drawn(chart: Chart) -> Drawing:
    """Draw a chart."""
    scales = [_scale(panel) for panel in chart.panels]
    ticks = [_y_ticks(panel, scale) for panel, scale in zip(chart.panels, scales, strict=True)]
    left = EDGE + 1.6 * LABEL + max(map(labels_width, ticks)) + GAP
    right = WIDTH - EDGE
    legend, rows = _legend(chart, left, right)
    top = EDGE + 1.5 * TITLE + rows * LEGEND_ROW + GAP
    boxes = _boxes(chart, left, right, top)
    below = GAP + 1.3 * LABEL + (1.5 * LABEL if chart.x_title else 0) + EDGE
    title = Text(left, EDGE + TITLE, chart.title, INK, TITLE, bold=True)
    drawing = Drawing(WIDTH, round(boxes[-1].bottom + below), [title, *legend])
    x = _x_scale(chart)
    for panel, scale, marks, box in zip(chart.panels, scales, ticks, boxes, strict=True):
        axes = equal_scales(box, x, scale) if chart.equal else Axes(box, x, scale)
        drawing.shapes.extend(_panel(panel, axes, _x_ticks(chart, axes), marks if panel.ticks else axes.y_ticks()))
    drawing.shapes.extend(axes.x_labels(_x_ticks(chart, axes), chart.x_title))
    return drawing


def aspect(chart: Chart) -> float:
    """Return height by width of a map, within limits that fit a page."""
    x, y = (_values(chart, name) for name in "xy")
    if not (np.isfinite(x).any() and np.isfinite(y).any()):
        return 0.5
    width, height = np.nanmax(x) - np.nanmin(x), np.nanmax(y) - np.nanmin(y)
    return float(np.clip(height / max(width, 1e-6), 0.3, 0.9))


def _values(chart: Chart, name: str) -> Array:
    """The x or y of all curves."""
    found = [getattr(curve, name) for panel in chart.panels for curve in panel.curves]
    return np.concatenate([np.zeros(0), *found])


def _boxes(chart: Chart, left: float, right: float, top: float) -> list[Box]:
    """The boxes of the panels, from above."""
    if chart.equal:
        return [Box(left, top, right, top + round(aspect(chart) * (right - left)))]
    count = len(chart.panels)
    height = round(PANEL_HEIGHT * max(count, FEW_PANELS) / count)
    return [Box(left, at, right, at + height) for at in top + np.arange(count) * (height + PANEL_GAP)]


def _scale(panel: Panel) -> Scale:
    """The y axis of a panel."""
    if panel.ticks:
        return Scale(-0.5, len(panel.ticks) - 0.5)
    values = np.concatenate([*(curve.y for curve in panel.curves), *(bars.heights for bars in panel.bars)])
    scale = Scale.around(values, log=panel.log)
    return Scale(0.0, max(scale.high, 1e-9)) if panel.from_zero else scale


def _x_scale(chart: Chart) -> Scale:
    if chart.categories:
        return Scale(-0.5, len(chart.categories) - 0.5)
    return Scale.around(_values(chart, "x"))


def _x_ticks(chart: Chart, axes: Axes) -> Ticks:
    return list(enumerate(chart.categories)) if chart.categories else axes.x_ticks()


def _y_ticks(panel: Panel, scale: Scale) -> Ticks:
    return list(enumerate(panel.ticks)) if panel.ticks else scale.ticks(PANEL_HEIGHT / Y_TICK)


def _panel(panel: Panel, axes: Axes, x_ticks: Ticks, y_ticks: Ticks) -> list[Shape]:
    shapes: list[Shape] = [axes.grid(x_ticks, y_ticks)]
    for k, bars in enumerate(panel.bars):
        width = BAR_GROUP / len(panel.bars)
        middles = np.arange(len(bars.heights)) + (k - (len(panel.bars) - 1) / 2) * width
        for middle, height in zip(middles, bars.heights, strict=True):
            if np.isfinite(height):
                ends = middle + 0.45 * width * np.array([-1, 1, 1, -1])
                shapes.append(Area(axes.at(ends, np.array([0, 0, height, height])), bars.colour))
    for curve in panel.curves:
        shapes += _curve(curve, axes)
    return [*shapes, *axes.y_labels(y_ticks, panel.y_title, EDGE + LABEL / 2)]


def _curve(curve: Curve, axes: Axes) -> list[Shape]:
    points = axes.at(curve.x, curve.y)
    shapes: list[Shape] = []
    if curve.width:
        shapes.append(Line(points, curve.colour, _width(curve), curve.dash, box=axes.box))
    if curve.symbol:
        shapes += [mark(point, curve.symbol, curve.colour) for point in points if np.isfinite(point).all()]
    return shapes


def _width(curve: Curve) -> float:
    return 0.75 * POINT * curve.width  # the page's pixels are 0.75 points


def _legend(chart: Chart, left: float, right: float) -> tuple[list[Shape], int]:
    """The entries of the legend, each label once, in rows below the title; and the number of rows."""
    entries: dict[str, Curve | str] = {}
    for panel in chart.panels:
        for curve in panel.curves:
            entries.setdefault(curve.label, curve)
        for bars in panel.bars:
            entries.setdefault(bars.label, bars.colour)
    if len(entries) < 2:
        return [], 0
    shapes: list[Shape] = []
    x, row = left, 0
    for label, entry in entries.items():
        width = SAMPLE + GAP + text_width(label, LEGEND)
        if x > left and x + width > right:
            x, row = left, row + 1
        y = EDGE + 1.5 * TITLE + (row + 0.6) * LEGEND_ROW
        shapes += _sample(entry, np.array([x, y]))
        shapes.append(Text(x + SAMPLE + GAP, y, label, INK, LEGEND, middle=True))
        x += width + 3 * GAP
    return shapes, row + 1


def _sample(entry: Curve | str, start: Array) -> list[Shape]:
    """What stands for a curve, or for bars of a colour, on the left of its label."""
    ends = start + np.array([[4, 0], [SAMPLE - 4, 0]])
    if isinstance(entry, str):
        return [Area(Box(*(ends[0] - [0, 8]), *(ends[1] + [0, 8])).corners, entry)]
    line: list[Shape] = [Line(ends, entry.colour, _width(entry), entry.dash)] if entry.width else []
    return [*line, *([mark(ends.mean(axis=0), entry.symbol, entry.colour)] if entry.symbol else [])]
