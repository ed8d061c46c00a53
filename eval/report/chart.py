"""Description of a chart, which the page draws with plotly and the files with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from slam.data.cloud import Array
from slam.data.plot_style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY_BLUE, VERMILION

#: Colour of each known input, the same in all charts; other rows take the remaining ones in turn.
KNOWN = {"16": VERMILION, "enriched": BLUE, "64": GREEN, "full": GREEN, "ray-segment": PURPLE}
OTHERS = (ORANGE, SKY_BLUE, PURPLE, VERMILION, GREEN, BLUE)
TRUTH = GREY
#: Most points of a line in a chart; longer lines keep the extremes of each stretch.
MOST = 3000

Dash = Literal["solid", "dash", "dot"]
Symbol = Literal["circle", "x", "triangle", "square"]


@dataclass(frozen=True, eq=False)
class Curve:
    """A line or single points; NaN interrupts a line.

    Attributes:
        x: (N,) in the unit of the x axis.
        y: (N,) in the unit of the y axis.
        label: Entry of the legend. Curves of one label share an entry.
        colour: '#RRGGBB'.
        dash: Style of the line.
        width: Width of the line [pixels]; 0 draws points only.
        symbol: Symbol of the points; None draws a line only.
    """

    x: Array
    y: Array
    label: str
    colour: str
    dash: Dash = "solid"
    width: float = 2.0
    symbol: Symbol | None = None


@dataclass(frozen=True, eq=False)
class Bars:
    """Bars of one label, one per category.

    Attributes:
        heights: (K,) in the unit of the y axis, NaN where there is none.
        label: Entry of the legend.
        colour: '#RRGGBB'.
    """

    heights: Array
    label: str
    colour: str


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes:
        y_title: Title of the y axis, with the unit.
        curves: Curves, drawn in this order.
        bars: Bars, grouped by category.
        ticks: Names at y = 0, 1, 2, ... in place of numbers.
        from_zero: Whether the y axis begins at 0.
        log: Whether the y axis is logarithmic.
    """

    y_title: str
    curves: Sequence[Curve] = ()
    bars: Sequence[Bars] = ()
    ticks: Sequence[str] = ()
    from_zero: bool = False
    log: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """A figure of one or several panels above each other, with a common x axis.

    Attributes:
        key: Name of its files and its anchor in the page.
        title: Title.
        caption: What is drawn and how, in a sentence or two.
        alt: What a reader who cannot see it has to know: the figures that stand out.
        x_title: Title of the x axis, with the unit.
        panels: At least one.
        categories: Names at the x axis, of bars.
        equal: Whether x and y have the same scale, as on a map.
    """

    key: str
    title: str
    caption: str
    alt: str
    x_title: str
    panels: Sequence[Panel]
    categories: Sequence[str] = field(default=())
    equal: bool = False


def colours(labels: Sequence[str]) -> dict[str, str]:
    """Return a colour for each row's label: known inputs always have the same one.

    Example:
        >>> colours(["16", "mine"]) == {"16": "#D55E00", "mine": "#E69F00"}
        True
    """
    chosen = {label: KNOWN[label] for label in labels if label in KNOWN}
    free = [colour for colour in OTHERS if colour not in chosen.values()] or list(OTHERS)
    others = [label for label in labels if label not in KNOWN]
    chosen |= {label: free[k % len(free)] for k, label in enumerate(others)}
    return {label: chosen[label] for label in labels}


def shortened(curve: Curve) -> Curve:
    """Return a curve of at most about MOST points: of each stretch the lowest and the highest one."""
    from dataclasses import replace

    count = len(curve.x)
    if count <= MOST:
        return curve
    kept = {0, count - 1}
    for stretch in np.array_split(np.arange(count), MOST // 2):
        y = curve.y[stretch]
        kept.update(stretch[~np.isfinite(y)][:1].tolist())
        if np.isfinite(y).any():
            kept.update((int(stretch[np.nanargmin(y)]), int(stretch[np.nanargmax(y)])))
    chosen = np.array(sorted(kept))
    return replace(curve, x=curve.x[chosen], y=curve.y[chosen])
