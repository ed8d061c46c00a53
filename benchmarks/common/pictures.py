"""Pictures of figures: colours, axes, and PNG files that are written whole."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slam.data.atomic import written_beside

#: Okabe and Ito's palette, told apart by colour-blind readers.
BLUE, SKY, GREEN, ORANGE, VERMILION, PURPLE, GREY = (
    "#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#999999",
)  # fmt: skip


def plain(axes: Axes) -> None:
    """A light grid, and no lines above and to the right."""
    axes.grid(color="#E8E8E8")
    axes.spines[["top", "right"]].set_visible(False)


def save(figure: Figure, path: Path, dpi: int) -> None:
    """Write the PNG, whole or not at all. Raises InputError where it cannot be written."""
    with written_beside(path) as temporary:
        figure.savefig(temporary, format="png", dpi=dpi, facecolor=figure.get_facecolor())
