"""Style of plots: colours that colour-blind readers can distinguish, plain axes, fixed margins; atomic PNG files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from slam.data.atomic import written_beside
from slam.data.cloud import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: The palette of Okabe and Ito, "Color Universal Design", 2008.
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY_BLUE, BLACK = OKABE_ITO = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000",
)  # fmt: skip
#: Colours of text, of grid lines and of background curves such as ground truth.
INK, GRID, GREY = "#222222", "#E8E8E8", "#B8B8B8"
#: Of PNG files: runs of equal bytes alone (3: zlib's Z_RLE): the same pixels in half of the time, in files as large.
QUICK = {"compress_level": 1, "compress_type": 3}
#: Distance [inches] of the titles of x axes from the axes, of y axes from the left border, if the margins are fixed.
X_TITLE, Y_TITLE = 0.27, 0.27
#: Mean width of a letter, of the size of the text.
LETTER = 0.6


def tidy(axes: Axes) -> None:
    """Draw a light grid behind the curves, without frame and ticks."""
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=INK, length=0, left=False, bottom=False)
    axes.spines[:].set_visible(False)


def margins(
    figure: Figure, left: float, right: float, bottom: float, top: float, *, gap_x: float = 0.0, gap_y: float = 0.0
) -> None:
    """Fix the place of a figure's subplots, and of the titles of their axes.

    matplotlib's layout engines measure every text, which takes several times as long as the drawing.

    Args:
        figure: The figure, with its subplots.
        left: Space [inches] on the left of all subplots, with their labels.
        right: Space [inches] on the right of them.
        bottom: Space [inches] below them.
        top: Space [inches] above them.
        gap_x: Space [inches] between subplots next to each other.
        gap_y: Space [inches] between subplots above each other.
    """
    from matplotlib.transforms import ScaledTranslation

    width, height = figure.get_size_inches()
    grid = figure.axes[0].get_gridspec()
    assert grid is not None
    rows, columns = grid.get_geometry()
    figure.subplots_adjust(
        left / width,
        bottom / height,
        1 - right / width,
        1 - top / height,
        wspace=gap_x / ((width - left - right - (columns - 1) * gap_x) / columns),
        hspace=gap_y / ((height - top - bottom - (rows - 1) * gap_y) / rows),
    )
    below, beside = (ScaledTranslation(x, y, figure.dpi_scale_trans) for x, y in ((0, -X_TITLE), (Y_TITLE - left, 0)))
    for axes in figure.axes:
        axes.xaxis.set_label_coords(0.5, 0, axes.transAxes + below)
        axes.yaxis.set_label_coords(0, 0.5, axes.transAxes + beside)


def fitting(text: str, size: float, width: float) -> float:
    """Return the size [points], at most `size`, at which a text fits into `width` [inches]."""
    return min(size, 72 * width / (LETTER * max(1, len(text))))


def pixels(figure: Figure, dpi: float) -> Array:
    """Draw a figure: (H, W, 3) uint8 RGB."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(np.asarray(canvas.buffer_rgba())[..., :3])


def save_png(figure: Figure, path: Path, dpi: float = 150) -> None:
    """Write a figure atomically; a figure made without pyplot needs no display and has no global state."""
    from PIL import Image

    with written_beside(path) as temporary:
        Image.fromarray(pixels(figure, dpi)).save(temporary, "PNG", **QUICK)
