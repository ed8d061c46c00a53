"""The picture of a depth benchmark: what is left of the error when only the surest predictions are taken."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eval.depth.tables import VIEWS
from eval.plot import GRID, INK, TRUTH
from slam.data.atomic import written_beside

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's palette, told apart by colour-blind readers.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def plot_risk_coverage(report: Mapping[str, Any], path_png: Path) -> None:
    """MAE of the surest predictions over their share, a panel a view, from what depth.json holds.

    Methods without sigma are single points at the share of returns that they predict. Below each curve, dotted, the
    same predictions sorted by their true error: what no sigma can beat.
    """
    from matplotlib.figure import Figure

    methods = {name: entry for name, entry in report.items() if name != "about"}
    views = [view for view in VIEWS if any(entry.get(view) for entry in methods.values())]
    figure = Figure(figsize=(5.2 * len(views), 4.6), layout="constrained")
    panels = figure.subplots(1, len(views), squeeze=False)[0]
    for axes, view in zip(panels, views, strict=True):
        for (name, entry), colour in zip(methods.items(), COLOURS * len(methods), strict=False):
            if entry.get(view) and entry[view]["mae_mm"] is not None:
                _curve(axes, entry[view], name, colour)
        _label(axes, VIEWS[view])
    panels[0].set_ylabel("MAE [mm]", color=INK)
    figure.suptitle(report["about"]["title"], x=0.01, ha="left", color=INK, fontsize=12, fontweight="bold")
    with written_beside(path_png) as temporary:
        figure.savefig(temporary, format="png", dpi=150, facecolor="white")


def _curve(axes: Axes, figures: Mapping[str, Any], name: str, colour: str) -> None:
    """Over the share of all held-out returns, so that leaving the difficult ones out is not rewarded."""
    curve = figures["risk_coverage"]
    if curve is None:
        axes.plot(100 * figures["coverage"], figures["mae_mm"], "s", color=colour, label=f"{name} (no sigma)")
        return
    share = [100 * figures["coverage"] * part for part in curve["coverage"]]
    axes.plot(share, curve["mae_mm"], color=colour, linewidth=1.8, label=name)
    axes.plot(share[-1], curve["mae_mm"][-1], "o", color=colour)
    axes.plot(share, curve["oracle_mm"], color=colour, linewidth=1, linestyle=":")


def _label(axes: Axes, title: str) -> None:
    axes.set_title(title, loc="left", color=INK, fontsize=11)
    axes.set_xlabel("share of the held-out returns [%], surest first", color=INK)
    axes.set_xlim(0, 102)
    axes.set_ylim(bottom=0)
    axes.plot([], [], color=TRUTH, linestyle=":", label="dotted: sorted by true error")
    axes.legend(frameon=False, fontsize=9)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=INK, length=0)
    axes.spines[:].set_visible(False)
