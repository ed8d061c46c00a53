"""Charts and pictures as PNG and SVG files, by matplotlib."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eval.report.chart import Chart, Curve, Panel
from slam.data.atomic import written_beside
from slam.data.plot_style import INK, fitting, margins, save_png, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DASHES = {"solid": "-", "dash": "--", "dot": ":"}
SYMBOLS = {"circle": "o", "x": "x", "triangle": "^", "square": "s"}
WIDTH, PANEL_HEIGHT = 8.0, 1.9  # inches
LEFT, RIGHT, BELOW, GAP = 0.95, 0.25, 0.55, 0.2  # inches around panels and between them
TITLE, LEGEND_ROW = 0.35, 0.2  # inches above the panels
NUMBER, TICKS = 0.5, 2.0  # inches for numbers, and at most for names, on the y axis
SAMPLE = 0.6  # inches of a line of the legend, with spaces
COLUMNS = 4  # of a legend, at most
DPI, SVG_DPI = 150, 110  # the second of images within an SVG: that of the page's pictures
BAR_GROUP = 0.8  # of the distance between two categories


def save(figure: Figure, folder: Path, key: str) -> None:
    """Write a figure as KEY.png and KEY.svg; text stays text in the SVG.

    Raises:
        InputError: A file cannot be written.
    """
    from matplotlib import rc_context

    save_png(figure, folder / f"{key}.png", DPI)
    with (
        rc_context({"svg.fonttype": "none", "svg.hashsalt": key}),
        written_beside(folder / f"{key}.svg") as temporary,
    ):
        figure.savefig(temporary, dpi=SVG_DPI, metadata={"Date": None})


def drawn(chart: Chart) -> Figure:
    """Draw a chart by matplotlib."""
    from matplotlib.figure import Figure

    count = len(chart.panels)
    names = [name for panel in chart.panels for name in panel.ticks]
    left = max(LEFT, LEFT - NUMBER + min(TICKS, max(map(_width, names), default=0.0)))
    labels = _labels(chart)
    widest = SAMPLE + max(map(_width, labels), default=0.0)
    columns = int(np.clip((WIDTH - left) / widest, 1, COLUMNS))
    rows = -(-len(labels) // columns) if len(labels) > 1 else 0
    above = TITLE + LEGEND_ROW * rows
    height = (WIDTH - left - RIGHT) * aspect(chart) if chart.equal else PANEL_HEIGHT * max(count, 1.6)
    figure = Figure((WIDTH, above + height + BELOW), facecolor="white")
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    margins(figure, left, RIGHT, BELOW, above, gap_y=GAP)
    for axis, panel in zip(axes, chart.panels, strict=True):
        _draw_panel(axis, panel, chart)
    axes[-1].set_xlabel(chart.x_title, color=INK)
    size = fitting(chart.title, 12, WIDTH - left)
    axes[0].set_title(
        chart.title, loc="left", y=1.0, fontsize=size, fontweight="bold", color=INK, pad=6 + 72 * LEGEND_ROW * rows
    )
    if rows:
        handles = dict(_handles(axes))
        place: Any = {"loc": "lower left", "bbox_to_anchor": (-0.01, 1.0), "borderaxespad": 0.2, "ncols": columns}
        size = fitting(max(labels, key=len), 9, WIDTH - left - SAMPLE)
        axes[0].legend(handles.values(), handles.keys(), frameon=False, fontsize=size, **place)
    return figure


def _labels(chart: Chart) -> set[str]:
    """The entries of the legend."""
    curves = {curve.label for panel in chart.panels for curve in panel.curves}
    return curves | {bars.label for panel in chart.panels for bars in panel.bars}


def _width(text: str) -> float:
    """Width [inches] of a label, about."""
    return 0.08 * len(text)


def aspect(chart: Chart) -> float:
    """Return height by width of a map, within limits that fit a page."""
    curves = [curve for panel in chart.panels for curve in panel.curves]
    x, y = (np.concatenate([getattr(curve, name) for curve in curves]) for name in "xy")
    if not (np.isfinite(x).any() and np.isfinite(y).any()):
        return 0.5
    width, height = np.nanmax(x) - np.nanmin(x), np.nanmax(y) - np.nanmin(y)
    return float(np.clip(height / max(width, 1e-6), 0.3, 0.9))


def _draw_panel(axis: Axes, panel: Panel, chart: Chart) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    for curve in panel.curves:
        _draw_curve(axis, curve)
    for k, bars in enumerate(panel.bars):
        width = BAR_GROUP / len(panel.bars)
        x = np.arange(len(bars.heights)) + (k - (len(panel.bars) - 1) / 2) * width
        axis.bar(x, bars.heights, 0.9 * width, color=bars.colour, label=bars.label)
    if panel.bars:
        axis.set_xticks(range(len(chart.categories)), chart.categories)
    if panel.ticks:
        size = fitting(max(panel.ticks, key=len), 10, TICKS)
        axis.set_yticks(range(len(panel.ticks)), panel.ticks, fontsize=size)
        axis.set_ylim(-0.5, len(panel.ticks) - 0.5)
    if panel.log:
        axis.set_yscale("log")
        axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_locator(NullLocator())
    if panel.from_zero:
        axis.set_ylim(bottom=0)
    if chart.equal:
        axis.set_aspect("equal", adjustable="datalim")
    axis.set_ylabel(panel.y_title, color=INK)
    tidy(axis)


def _draw_curve(axis: Axes, curve: Curve) -> None:
    axis.plot(
        curve.x,
        curve.y,
        label=curve.label,
        color=curve.colour,
        linestyle=DASHES[curve.dash] if curve.width else "",
        linewidth=0.75 * curve.width,  # points instead of pixels
        marker=SYMBOLS[curve.symbol] if curve.symbol else None,
        markersize=5,
        solid_capstyle="round",
    )


def _handles(axes: Any) -> Iterator[tuple[str, Any]]:
    """The entries of the legend, each label once."""
    for axis in axes:
        handles, labels = axis.get_legend_handles_labels()
        yield from zip(labels, handles, strict=True)
