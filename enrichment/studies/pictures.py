"""Plots of the studies: one frame, and curves of the figures over all frames."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enrichment.studies.depth_image import FARTHEST, DepthImage, discontinuities
from enrichment.studies.edges import EdgeFigures, canny, grey_of, near
from enrichment.studies.figures import Figures
from enrichment.studies.sparsity import SELECTIONS, SparsityFigures, reconstruct
from slam.data.cloud import Array
from slam.data.plot_style import BLUE, INK, VERMILION, save_png, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = (1 / 4, 1 / 16, 1 / 64)  # fractions of the coefficients of the reconstructions shown
SHOWN_THRESHOLD = 90  # threshold of the Canny edges shown
NEAREST = 4.0  # m, lower end of the colour scale of depth
WIDTH = 13.0  # inches
COLOURS = (BLUE, VERMILION)
DPI = 120
BOTH, EDGE_ONLY, JUMP_ONLY = (0, 255, 130), (255, 150, 0), (255, 90, 220)  # bright, for a dark background
LINES = ("-", "--")  # a line style for each source of depth


def draw_sparsity(
    image: DepthImage, sources: Mapping[str, Figures[SparsityFigures]], title: str, path_png: Path
) -> None:
    """Draw reconstructions of a depth image from few coefficients, and curves of the error and of preserved heights.

    Args:
        image: Depth image of one frame.
        sources: Figures by source of the depth.
        title: Title of the figure.
        path_png: The file to write, atomically.
    """
    rows = 1 + len(SHOWN)
    figure, panels, curves = _layout(title, rows, image)
    panels[0, 0].imshow(image.image)
    panels[0, 0].set_title("image", **_small())
    _depth(panels[0, 1], image.depth, "depth, all coefficients (red near, blue far)")
    for row, fraction in enumerate(SHOWN, 1):
        for column, selection in enumerate(SELECTIONS):
            depth = reconstruct(image.depth, fraction, selection)
            _depth(panels[row, column], depth, f"1/{round(1 / fraction)} of the coefficients, the {selection}")
    for axes, key, factor, quantity in (
        (curves[0], "rmse_m", 1, "RMSE [m]"),
        (curves[1], "height_kept", 100, "height of discontinuities kept [%]"),
    ):
        for (source, figures), line in zip(sources.items(), LINES, strict=False):
            for (selection, fractions), colour in zip(figures.items(), COLOURS, strict=True):
                values = [factor * getattr(entry, key) for entry in fractions.values()]
                label = f"{selection}, {source}"
                axes.plot(list(fractions), values, line, marker="o", markersize=4, color=colour, label=label)
        axes.set_xscale("log", base=2)
        axes.set_xticks([2.0**-k for k in range(7)], ["1", *(f"1/{2**k}" for k in range(1, 7))])
        axes.invert_xaxis()
        _labelled(axes, "share of the coefficients kept", quantity)
    curves[0].legend(frameon=False, fontsize=9)
    save_png(figure, path_png, DPI)


def draw_edges(image: DepthImage, sources: Mapping[str, Figures[EdgeFigures]], title: str, path_png: Path) -> None:
    """Draw a frame with its edges and depth discontinuities, and precision over recall for all thresholds."""
    figure, panels, curves = _layout(title, 2, image, columns=1)
    panels[0, 0].imshow(overlay(image))
    panels[0, 0].set_title(
        f"Canny edges, threshold {SHOWN_THRESHOLD}: green on a depth discontinuity, orange elsewhere; "
        "pink: discontinuities without an edge; dark: no returns",
        **_small(),
    )
    _depth(panels[1, 0], image.depth, "depth (red near, blue far)")
    for axes, detector in zip(curves, ("canny", "gradient"), strict=True):
        for (source, figures), line in zip(sources.items(), LINES, strict=False):
            entries = figures[detector]
            recall, precision, chance = (
                [100 * getattr(entry, key) for entry in entries.values()]
                for key in ("recall", "precision", "precision_by_chance")
            )
            axes.plot(recall, precision, line, marker="o", markersize=4, color=COLOURS[0], label=source)
            axes.plot(recall, chance, line, color="#999999", label=f"{source}, by chance")
            for threshold, x, y in zip(entries, recall, precision, strict=True):
                axes.annotate(f"{threshold:g}", (x, y), (3, 4), textcoords="offset points", fontsize=7, color=INK)
        axes.set_xlim(0, 100)
        axes.set_ylim(bottom=0)
        _labelled(axes, "recall [%]: discontinuities with an edge", "precision [%]: edges on one")
        axes.set_title(f"{detector}, by threshold", **_small())
    curves[0].legend(frameon=False, fontsize=9)
    save_png(figure, path_png, DPI)


def overlay(image: DepthImage) -> Array:
    """Draw edges and depth discontinuities over a darkened grey image; (H, W, 3) uint8."""
    lines = discontinuities(image.depth).any(axis=0) & image.known
    found = canny(grey_of(image), SHOWN_THRESHOLD) & image.known
    shades = np.where(image.known, 0.6, 0.2) * grey_of(image)
    result = np.repeat(shades[..., None].astype(np.uint8), 3, axis=2)
    result[lines & ~near(found)] = JUMP_ONLY
    result[found] = EDGE_ONLY
    result[found & near(lines)] = BOTH
    return result


def _layout(title: str, rows: int, image: DepthImage, columns: int = 2) -> tuple[Figure, Any, Any]:
    """A figure, its image panels (rows, columns), and two panels for curves below them."""
    from matplotlib.figure import Figure

    height, width = image.depth.shape
    pictures = rows * (WIDTH / columns * height / width + 0.3)
    figure = Figure(figsize=(WIDTH, pictures + 4.4), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.1, h_pad=0.06)  # type: ignore[union-attr, call-arg]
    parts: Any = figure.subfigures(2, 1, height_ratios=[pictures, 4.0])
    panels = parts[0].subplots(rows, columns, squeeze=False)
    for axes in panels.flat:
        axes.set_axis_off()
    figure.suptitle(title, x=0.01, ha="left", color=INK, fontsize=13, fontweight="bold")
    return figure, panels, parts[1].subplots(1, 2)


def _depth(axes: Axes, depth: Array, title: str) -> None:
    """Show depth with a logarithmic colour scale."""
    axes.imshow(np.log(np.clip(depth, NEAREST, FARTHEST)), cmap="turbo_r", vmin=np.log(NEAREST), vmax=np.log(FARTHEST))
    axes.set_title(title, **_small())


def _small() -> dict[str, Any]:
    return {"loc": "left", "color": INK, "fontsize": 10}


def _labelled(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    tidy(axes)
