"""Pictures drawn by matplotlib alone: a scan from above and in the camera image, the maps next to each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eval.report.scan import Scan
from slam.data.camera import project, visible
from slam.data.cloud import Array
from slam.data.from_above import highest_last
from slam.data.plot_style import INK, fitting, margins
from slam.data.point_files import Points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

DARK, MEASURED = "#101418", "#D8E4EC"  # background of points, and measured points on it
SIGMA_MAP, DEPTH_MAP, HEIGHT_MAP = "plasma", "viridis_r", "viridis"
MOST_SIGMA = 0.5  # m, the brightest colour
REACH = 30.0  # m ahead, behind and to both sides of the sensor in the view from above
NEAR, FAR = 3.0, 50.0  # m of depth, limits of its colours
SQUARE = np.array([[-REACH, -REACH], [REACH, REACH]])
PIXELS = 480  # along the longer side of a view from above
WIDTH, SINGLE = 12.0, 8.0  # inches of a picture of several views, and of one
LEFT, RIGHT, BELOW, ABOVE, GAP = 0.75, 0.2, 0.55, 0.35, 0.4  # inches around views and between them
BAR, BAR_SPACE = 0.15, 0.9  # inches: width of a colour bar; of it, its labels and the gap
TALLEST = 26.0  # inches of all camera images
DIMMED = 0.55  # brightness of the camera image below points
DOT = 2  # pixels of a point in the camera image
SAMPLED = 100_000  # points of a map that its limits are computed from, about
LOWEST, HIGHEST = 0.02, 0.98  # quantiles of the height, limits of its colours


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure that is the same in the page and in the files.

    Attributes:
        key: Name of its files and its anchor in the page.
        title: Title.
        caption: What is drawn.
        alt: Description for a reader who cannot see it.
        figure: The matplotlib figure.
    """

    key: str
    title: str
    caption: str
    alt: str
    figure: Figure


def scan_from_above(scans: Mapping[str, Scan]) -> Picture:
    """Draw one scan of each row from above: measured points, and predicted points by sigma (Fig. 5 of the paper)."""
    predicted = any(not scan.cloud.measured.all() for scan in scans.values())
    figure, axes = _beside(len(scans), 1.0, predicted)
    sigma = _scale(SIGMA_MAP, 0, MOST_SIGMA)
    for axis, (label, scan) in zip(axes, scans.items(), strict=True):
        cloud = scan.cloud.select(np.abs(scan.cloud.xyz[:, :2]).max(axis=1, initial=0) < REACH)
        new, old = cloud.select(~cloud.measured), cloud.select(cloud.measured)
        image = _from_above(new.xyz, sigma.to_rgba(new.sigma, bytes=True), SQUARE)
        pale = _from_above(old.xyz, np.tile(_pale(), (len(old), 1)), SQUARE)
        image[pale[..., 3] > 0] = pale[pale[..., 3] > 0]
        _show(axis, image, SQUARE, f"{label}: {len(scan.cloud):,} points", "x, forward [m]")
    axes[0].set_ylabel("y, left [m]")
    if predicted:
        _colour_bar(figure, sigma, "sigma of the predicted range [m]")
    number = next(iter(scans.values())).number
    counts = "; ".join(
        f"{label} {scan.cloud.measured.sum():,} measured and {(~scan.cloud.measured).sum():,} predicted points"
        for label, scan in scans.items()
    )
    return Picture(
        "scan",
        f"Frame {number} from above",
        "The scan as the odometry received it. Pale: measured returns; coloured: points that enrichment predicted, by "
        "the predicted sigma of their range, as in Fig. 5 of the paper by Yue et al.",
        f"Frame {number} from above: {counts}.",
        figure,
    )


def scan_in_image(scans: Mapping[str, Scan]) -> Picture | None:
    """Draw the camera image, and the depth of each row's scan over it; None without an image and its calibration."""
    seen = {label: scan for label, scan in scans.items() if scan.image is not None and scan.calibration is not None}
    if not seen:
        return None
    from matplotlib.figure import Figure

    image = next(iter(seen.values())).image
    assert image is not None
    rows, aspect = len(seen) + 1, image.shape[0] / image.shape[1]
    width = min(SINGLE, TALLEST / rows / aspect)
    figure = Figure((RIGHT + width + BAR_SPACE, rows * (ABOVE + aspect * width) + RIGHT), facecolor="white")
    axes = figure.subplots(rows, 1)
    margins(figure, RIGHT, BAR_SPACE, RIGHT, ABOVE, gap_y=ABOVE)
    depth = _scale(DEPTH_MAP, NEAR, FAR)
    views = {"camera image": image} | dict(_overlay(scan, label, depth) for label, scan in seen.items())
    for axis, (title, view) in zip(axes, views.items(), strict=True):
        axis.imshow(view, aspect="auto")
        axis.set(xticks=[], yticks=[])
        axis.spines[:].set_visible(False)
        _titled(axis, title, width)
    _colour_bar(figure, depth, "depth [m]")
    number = next(iter(seen.values())).number
    return Picture(
        "image",
        f"Frame {number} in the camera image",
        "The camera image, and over it the depth of the points of each input; points hidden behind nearer ones are "
        "left out.",
        f"Camera image of frame {number}, and the depth of the points of {', '.join(seen)} over it.",
        figure,
    )


def maps_beside(maps: Mapping[str, Points]) -> Picture:
    """Draw the maps from above on one scale (Fig. 6 of the paper)."""
    some = np.concatenate([points.xyz[:: max(1, len(points.xyz) // SAMPLED)] for points in maps.values()])
    low, high = np.quantile(some, (0.002, 0.998), axis=0)
    box = np.stack([low - 5, high + 5])[:, :2]
    width, height = box[1] - box[0]
    figure, axes = _beside(len(maps), float(np.clip(height / width, 0.35, 1.6)), bar=True)
    z = _scale(HEIGHT_MAP, *np.quantile(some[:, 2], (LOWEST, HIGHEST)))
    for axis, (label, points) in zip(axes, maps.items(), strict=True):
        _show(axis, _from_above(points.xyz, z.to_rgba(points.xyz[:, 2], bytes=True), box), box, label, "x [m]")
    axes[0].set_ylabel("y [m]")
    _colour_bar(figure, z, "height z [m]")
    return Picture(
        "maps",
        "Maps from above" if len(maps) > 1 else "Map from above",
        "Height by colour, on one scale, all points, as in Fig. 6 of the paper by Yue et al.",
        f"Maps of {', '.join(maps)} from above, next to each other.",
        figure,
    )


def on_dark(figure: Figure) -> Figure:
    """Give a picture a dark ground and pale text; returns the same figure."""
    from matplotlib.text import Text

    figure.set_facecolor(DARK)
    for text in figure.findobj(Text):
        text.set_color(MEASURED)
    for axis in figure.axes:
        axis.tick_params(colors=MEASURED)
    return figure


def _scale(colours: str, low: float, high: float) -> ScalarMappable:
    """Colours of values from `low` to `high`."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(low, high), colours)


def _pale() -> Array:
    """Colour (4,) uint8 of measured points."""
    from matplotlib.colors import to_rgba_array

    return np.asarray(255 * to_rgba_array(MEASURED)[0]).astype(np.uint8)


def _from_above(xyz: Array, colours: Array, box: Array) -> Array:
    """Image (H, W, 4) uint8 of points from above, first row at the lowest y, transparent where there is none.

    Each pixel shows its highest point. An image is drawn in no time and in a small file, unlike a marker per point.

    Args:
        xyz: Points (N, 3) [m].
        colours: Their colours (N, 4) uint8.
        box: Lower and upper corner (2, 2) [m].
    """
    low, extent = box[0], box[1] - box[0]
    pixel = float(extent.max()) / PIXELS
    width, height = np.maximum(np.rint(extent / pixel).astype(int), 1)
    column, row = np.floor((xyz[:, :2] - low) / pixel).astype(np.int32).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    order = highest_last(xyz[:, 2])
    order = order[inside[order]]
    image = np.zeros((height, width, 4), np.uint8)
    image[row[order], column[order]] = colours[order]
    return image


def _show(axis: Axes, image: Array, box: Array, title: str, x_title: str) -> None:
    """Draw an image of a `box` (2, 2) from above."""
    x, y = box.T.tolist()
    axis.imshow(image, origin="lower", extent=(*x, *y), interpolation="none")
    axis.set(xlim=x, ylim=y, xlabel=x_title)
    _titled(axis, title, axis.get_window_extent().width / axis.figure.dpi)


def _overlay(scan: Scan, label: str, colours: ScalarMappable) -> tuple[str, Array]:
    """Title, and the darkened image (H, W, 3) uint8 with the depth of the points, near ones above far ones."""
    assert scan.image is not None
    assert scan.calibration is not None
    pixels, depth = project(scan.cloud.xyz, scan.calibration)
    shown = visible(pixels, depth, scan.image.shape)
    order = np.argsort(-depth[shown])
    column, row = np.rint(pixels[shown][order] - DOT / 2).astype(np.int32).T
    image = np.repeat((scan.image.mean(axis=2, keepdims=True) * DIMMED).astype(np.uint8), 3, axis=2)
    dots = colours.to_rgba(depth[shown][order], bytes=True)[:, :3]
    for down, right in np.ndindex(DOT, DOT):
        image[np.clip(row + down, 0, len(image) - 1), np.clip(column + right, 0, image.shape[1] - 1)] = dots
    return f"{label}: {shown.sum():,} points in the image", image


def _beside(count: int, aspect: float, bar: bool) -> tuple[Figure, list[Axes]]:
    """A figure with axes next to each other, on a dark background, with space for a colour bar."""
    from matplotlib.figure import Figure

    width = WIDTH if count > 1 else SINGLE
    right = BAR_SPACE if bar else RIGHT
    side = (width - LEFT - right - GAP * (count - 1)) / count
    figure = Figure((width, ABOVE + side * aspect + BELOW), facecolor="white")
    axes: Array = figure.subplots(1, count, squeeze=False, sharey=True)[0]
    margins(figure, LEFT, right, BELOW, ABOVE, gap_x=GAP)
    for axis in axes:
        axis.set_facecolor(DARK)
        axis.tick_params(colors=INK, labelsize=8, length=0, left=False, bottom=False)
        axis.spines[:].set_visible(False)
    return figure, list(axes)


def _colour_bar(figure: Figure, colours: ScalarMappable, title: str) -> None:
    """Draw a colour bar on the right of the axes, in the space for it."""
    width = figure.get_figwidth()
    first, last = (figure.axes[k].get_position(original=True) for k in (0, -1))
    axis = figure.add_axes((last.x1 + BAR / width, last.y0, BAR / width, first.y1 - last.y0))
    figure.colorbar(colours, cax=axis, label=title)


def _titled(axis: Axes, title: str, width: float) -> None:
    """Write a title of at most `width` [inches]."""
    axis.set_title(title, loc="left", y=1.0, fontsize=fitting(title, 11, width), color=INK)
