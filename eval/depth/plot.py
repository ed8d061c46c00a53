"""Risk-coverage plot of a depth benchmark: the error of the share of predictions with the smallest sigma."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

from eval.depth.metrics import RangeFigures
from eval.depth.report import VIEWS, DepthReport
from slam.data.plot_style import GREY, INK, OKABE_ITO, save_png, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_risk_coverage(report: DepthReport, path_png: Path) -> None:
    """Draw the MAE of the predictions with the smallest sigma over their share, one panel per view.

    Methods without sigma are single points at their coverage. The dotted curve is sorted by the true error, which is a
    lower bound for any sigma.

    Args:
        report: Report of a sequence.
        path_png: The file to write, atomically.
    """
    from matplotlib.figure import Figure

    views = [view for view in VIEWS if any(getattr(method, view) for method in report.methods.values())]
    figure = Figure(figsize=(5.2 * len(views), 4.6), layout="constrained")
    panels = figure.subplots(1, len(views), squeeze=False)[0]
    for axes, view in zip(panels, views, strict=True):
        for (name, method), colour in zip(report.methods.items(), cycle(OKABE_ITO), strict=False):
            if figures := getattr(method, view):
                _curve(axes, figures, name, colour)
        _label(axes, VIEWS[view])
    panels[0].set_ylabel("MAE [mm]", color=INK)
    figure.suptitle(report.about.title, x=0.01, ha="left", color=INK, fontsize=12, fontweight="bold")
    save_png(figure, path_png)


def _curve(axes: Axes, figures: RangeFigures, name: str, colour: str) -> None:
    """Draw a method over the share of all held-out returns, so that skipping difficult returns is not rewarded."""
    if figures.coverage is None or figures.mae_mm is None:
        return
    coverage, curve = 100 * figures.coverage, figures.risk_coverage
    if curve is None:
        axes.plot(coverage, figures.mae_mm, "s", color=colour, label=f"{name} (no sigma)")
        return
    share = [coverage * part for part in curve.coverage]
    axes.plot(share, curve.mae_mm, color=colour, linewidth=1.8, label=name)
    axes.plot(share[-1], curve.mae_mm[-1], "o", color=colour)
    axes.plot(share, curve.oracle_mm, color=colour, linewidth=1, linestyle=":")


def _label(axes: Axes, title: str) -> None:
    axes.set_title(title, loc="left", color=INK, fontsize=11)
    axes.set_xlabel("share of the held-out returns [%], smallest sigma first", color=INK)
    axes.set_xlim(0, 102)
    axes.set_ylim(bottom=0)
    axes.plot([], [], color=GREY, linestyle=":", label="dotted: sorted by true error")
    axes.legend(frameon=False, fontsize=9)
    tidy(axes)
