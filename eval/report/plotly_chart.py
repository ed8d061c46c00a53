"""Charts as plotly's JSON; colours of text and grid are those of the page's theme, set by the page's script."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

import numpy as np

from eval.report.chart import TRUTH, Chart, Curve, Panel, shortened
from eval.report.draw import aspect
from slam.data.cloud import Array

DASHES = {"solid": "solid", "dash": "dash", "dot": "dot"}
SYMBOLS = {"circle": "circle-open", "x": "x-thin-open", "triangle": "triangle-up", "square": "square"}
GAP = 0.06  # between two panels, of the height of all
PANEL_HEIGHT, FRAME_HEIGHT = 170, 110  # pixels


def plotly_chart(chart: Chart) -> dict[str, Any]:
    """Return `data` and `layout` of a chart for Plotly.newPlot, and the height by width of a map."""
    count = len(chart.panels)
    height = (1 - GAP * (count - 1)) / count
    layout: dict[str, Any] = {
        "xaxis": {"title": {"text": chart.x_title}, "anchor": _axis(count - 1), "automargin": True, "zeroline": False},
        "height": FRAME_HEIGHT + PANEL_HEIGHT * max(count, 1.6),
    }
    data: list[dict[str, Any]] = []
    seen: set[str] = set()
    for k, panel in enumerate(chart.panels):
        top = 1 - k * (height + GAP)
        layout[_axis(k).replace("y", "yaxis")] = _y_axis(panel, [max(top - height, 0.0), top])
        data += [_trace(shortened(curve), _axis(k), seen) for curve in panel.curves]
        data += [
            {
                "type": "bar",
                "x": list(chart.categories),
                "y": [None if np.isnan(value) else round(float(value), 3) for value in bars.heights],
                "name": bars.label,
                "marker": {"color": bars.colour},
                "hovertemplate": "%{x}: %{y:.2f} ms<extra>%{fullData.name}</extra>",
            }
            for bars in panel.bars
        ]
    if chart.equal:
        layout["yaxis"] |= {"scaleanchor": "x", "scaleratio": 1}
        layout["xaxis"]["range"], layout["yaxis"]["range"] = (_range(chart, name) for name in "xy")
    result = {"data": data, "layout": layout}
    return result | ({"aspect": aspect(chart)} if chart.equal else {})


def packed(values: Array, dtype: str) -> dict[str, str]:
    """Return an array as plotly reads it: its type ('f4', 'i2', 'u1') and its bytes in base64."""
    little = np.ascontiguousarray(values, np.dtype(dtype).newbyteorder("<"))
    return {"dtype": dtype, "bdata": b64encode(little.tobytes()).decode("ascii")}


def _range(chart: Chart, name: str) -> list[float]:
    """Limits of a map with a margin."""
    values = np.concatenate([getattr(curve, name) for panel in chart.panels for curve in panel.curves])
    if not np.isfinite(values).any():
        return [-1.0, 1.0]
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.04 * (high - low) + 0.5
    return [low - margin, high + margin]


def _axis(k: int) -> str:
    return "y" if k == 0 else f"y{k + 1}"


def _y_axis(panel: Panel, domain: list[float]) -> dict[str, Any]:
    axis: dict[str, Any] = {"title": {"text": panel.y_title}, "domain": domain, "automargin": True, "zeroline": False}
    if panel.ticks:
        axis |= {"tickvals": list(range(len(panel.ticks))), "ticktext": list(panel.ticks)}
        axis |= {"range": [-0.5, len(panel.ticks) - 0.5]}
    elif panel.log:
        axis |= {"type": "log", "dtick": "D2"}
    elif panel.from_zero:
        axis["rangemode"] = "tozero"
    return axis


def _trace(curve: Curve, axis: str, seen: set[str]) -> dict[str, Any]:
    modes = [mode for mode, there in (("lines", curve.width > 0), ("markers", curve.symbol)) if there]
    trace: dict[str, Any] = {
        "type": "scatter",
        "mode": "+".join(modes),
        "x": packed(curve.x, "f4"),
        "y": packed(curve.y, "f4"),
        "yaxis": axis,
        "name": curve.label,
        "legendgroup": curve.label,
        "showlegend": curve.label not in seen,
        "line": {"color": curve.colour, "width": curve.width, "dash": DASHES[curve.dash]},
        "connectgaps": False,
    }
    if curve.colour == TRUTH:
        trace |= {"truth": True, "marker": {}}  # the page's script gives it the colour of the theme
    if curve.symbol:
        trace["marker"] = {"color": curve.colour, "symbol": SYMBOLS[curve.symbol], "size": 8}
        trace["marker"]["line"] = {"width": 2 if "open" in SYMBOLS[curve.symbol] else 0}
    seen.add(curve.label)
    return trace
