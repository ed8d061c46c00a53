"""Pictures drawn by matplotlib alone: a scan from above and in the camera image, the maps next to each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from eval.report.scan import Scan
from slam.data.camera import project, visible
from slam.data.cloud import Array
from slam.data.plot_style import INK
from slam.data.point_files import Points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

DARK, MEASURED = "#101418", "#D8E4EC"  # background of points, and measured points on it
SIGMA_MAP, DEPTH_MAP, HEIGHT_MAP = "plasma", "viridis_r", "viridis"
MOST_SIGMA = 0.5  # m, the brightest colour
REACH = 30.0  # m ahead, behind and to both sides of the sensor in the view from above
NEAR, FAR = 3.0, 50.0  # m of depth, limits of its colours
SQUARE = np.array([[-REACH, -REACH], [REACH, REACH]])
PIXELS = 480  # along the longer side of a view from above
WIDTH = 12.0  # inches of a picture
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
    from matplotlib.colors import ListedColormap

    figure, axes = _beside(len(scans), 1.0)
    predicted = None
    for axis, (label, scan) in zip(axes, scans.items(), strict=True):
        cloud = scan.cloud.select(np.abs(scan.cloud.xyz[:, :2]).max(axis=1, initial=0) < REACH)
        new, old = cloud.select(~cloud.measured), cloud.select(cloud.measured)
        dots = _dots(axis, new.xyz, new.sigma, SQUARE, SIGMA_MAP, (0, MOST_SIGMA))
        _dots(axis, old.xyz, np.zeros(len(old)), SQUARE, ListedColormap([MEASURED]), (0, 1))
        axis.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), xlabel="x, forward [m]", aspect="equal")
        _titled(axis, f"{label}: {len(scan.cloud):,} points")
        predicted = dots if len(new) else predicted
    axes[0].set_ylabel("y, left [m]")
    if predicted is not None:
        figure.colorbar(predicted, ax=list(axes), pad=0.01, label="sigma of the predicted range [m]")
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
    rows = len(seen) + 1
    height = min(2.6 * WIDTH, (WIDTH - 1) * image.shape[0] / image.shape[1] * rows / 1.0 + 0.35 * rows) / 1.45
    figure = Figure(figsize=(WIDTH / 1.45, height), layout="constrained", facecolor="white")
    axes = figure.subplots(rows, 1)
    axes[0].imshow(image)
    _titled(axes[0], "camera image")
    for axis, (label, scan) in zip(axes[1:], seen.items(), strict=True):
        dots = _overlay(axis, scan, label)
    for axis in axes:
        axis.set(xticks=[], yticks=[], xlim=(0, image.shape[1]), ylim=(image.shape[0], 0))
        axis.spines[:].set_visible(False)
    figure.colorbar(dots, ax=list(axes), pad=0.01, label="depth [m]", shrink=0.6, aspect=40)
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
    corners = np.concatenate([np.quantile(points.xyz, (0.002, 0.998), axis=0) for points in maps.values()])
    low, high = corners.min(axis=0) - 5, corners.max(axis=0) + 5
    aspect = float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.35, 1.6))
    z = np.concatenate([points.xyz[:, 2] for points in maps.values()])
    lowest, highest = np.quantile(z, (LOWEST, HIGHEST)).tolist()
    figure, axes = _beside(len(maps), aspect)
    for axis, (label, points) in zip(axes, maps.items(), strict=True):
        dots = _dots(axis, points.xyz, points.xyz[:, 2], np.stack([low, high])[:, :2], HEIGHT_MAP, (lowest, highest))
        axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", aspect="equal")
        _titled(axis, label)
    axes[0].set_ylabel("y [m]")
    figure.colorbar(dots, ax=list(axes), pad=0.01, label="height z [m]")
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


def _dots(axis: Axes, xyz: Array, values: Array, box: Array, colours: Any, limits: tuple[float, float]) -> AxesImage:
    """Draw points from above, a pixel each, the highest of a pixel; `box` (2, 2): lower and upper corner [m].

    An image is drawn in no time and in a small file, unlike a marker per point.
    """
    low, high = box
    pixel = float((high - low).max()) / PIXELS
    width, height = np.maximum(np.ceil((high - low) / pixel).astype(int), 1)
    image = np.full((height, width), np.nan, np.float32)
    order = np.argsort(xyz[:, 2], kind="stable")
    column, row = np.floor((xyz[order, :2] - low) / pixel).astype(np.int64).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    image[row[inside], column[inside]] = values[order][inside]
    extent = (low[0], low[0] + width * pixel, low[1], low[1] + height * pixel)
    style: Any = {"cmap": colours, "vmin": limits[0], "vmax": limits[1], "interpolation": "nearest"}
    return axis.imshow(image, origin="lower", extent=extent, **style)


def _overlay(axis: Axes, scan: Scan, label: str) -> PathCollection:
    """Draw the depth of the points over the darkened image."""
    assert scan.image is not None
    assert scan.calibration is not None
    pixels, depth = project(scan.cloud.xyz, scan.calibration)
    shown = visible(pixels, depth, scan.image.shape)
    order = np.argsort(-depth[shown])
    u, v = pixels[shown][order].T
    grey = np.repeat((scan.image.mean(axis=2, keepdims=True) * 0.55).astype(np.uint8), 3, axis=2)
    axis.imshow(grey)
    _titled(axis, f"{label}: {shown.sum():,} points in the image")
    return axis.scatter(u, v, c=depth[shown][order], s=1.2, lw=0, cmap=DEPTH_MAP, vmin=NEAR, vmax=FAR, rasterized=True)


def _beside(count: int, aspect: float) -> tuple[Figure, list[Axes]]:
    """A figure with axes next to each other, on a dark background."""
    from matplotlib.figure import Figure

    width = WIDTH if count > 1 else 8.0
    height = (width - 1.6) / count * aspect + 0.9
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    axes: Array = figure.subplots(1, count, squeeze=False, sharey=True)[0]
    for axis in axes:
        axis.set_facecolor(DARK)
        axis.tick_params(colors=INK, labelsize=8, length=0)
        axis.spines[:].set_visible(False)
    return figure, list(axes)


def _titled(axis: Axes, title: str) -> None:
    axis.set_title(title, loc="left", fontsize=11, color=INK)
