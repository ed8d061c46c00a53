"""Pictures of pixels: a scan from above and in the camera image, the maps next to each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from eval.report.scan import Scan
from slam.data.camera import project, visible
from slam.data.cloud import Array
from slam.data.drawing.axes import BAR, GAP, LABEL, X_TICK, Axes, Scale, colour_bar, colour_bar_width, equal_scales
from slam.data.drawing.colours import ColourMap, colours_of, rgb
from slam.data.drawing.from_above import highest_last
from slam.data.drawing.shapes import POINT, Box, Drawing, Text
from slam.data.drawing.shapes import Picture as Image
from slam.data.plot_style import INK
from slam.data.point_files import Points

DARK, MEASURED = "#101418", "#D8E4EC"  # background of points, and measured points on it
SIGMA_MAP: ColourMap = "plasma"
DEPTH_MAP: ColourMap = "viridis"  # near is bright
HEIGHT_MAP: ColourMap = "viridis"
#: A view from above of axes, as an image (H, W, 3) uint8 RGB.
View = Callable[[Axes], Array]
#: Colour map, lowest and highest value, and title of a colour bar.
Bar = tuple[ColourMap, float, float, str]
MOST_SIGMA = 0.5  # m, the brightest colour
REACH = 30.0  # m ahead, behind and to both sides of the sensor in the view from above
NEAR, FAR = 3.0, 50.0  # m of depth, limits of its colours
PIXELS = 480  # along the longer side of a view from above
WIDTH, SINGLE = 1800, 1200  # pixels of a picture of several views, and of one
EDGE = 14  # pixels between the border and what is drawn
TITLE, SMALL = 11 * POINT, 8 * POINT  # sizes of text
MIN_ASPECT, MAX_ASPECT = 0.35, 1.6  # height by width of a view
MAX_HEIGHT = 4000  # pixels of all camera images
ABOVE = 1.6 * TITLE  # pixels of a title
DIMMED = 0.55  # brightness of the camera image below points
DOT = 2  # pixels of a point in the camera image
SAMPLED = 100_000  # points of a map that its limits are computed from, about
LOWEST, HIGHEST = 0.02, 0.98  # quantiles of the height, limits of its colours


@dataclass(frozen=True, eq=False)
class Picture:
    """A drawing that is the same in the page and in the files.

    Attributes:
        key: Name of its files and its anchor in the page.
        title: Title.
        caption: What is drawn.
        alt: Description for a reader who cannot see it.
        drawing: The drawing.
    """

    key: str
    title: str
    caption: str
    alt: str
    drawing: Drawing


def scan_from_above(scans: Mapping[str, Scan]) -> Picture:
    """Draw one scan of each row from above: measured points, and predicted points by sigma (Fig. 5 of the paper)."""
    views = {f"{label}: {len(scan.cloud):,} points": partial(_scan_view, scan) for label, scan in scans.items()}
    predicted = any(not scan.cloud.measured.all() for scan in scans.values())
    bar = (SIGMA_MAP, 0.0, MOST_SIGMA, "sigma of the predicted range [m]") if predicted else None
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
        _beside(views, Scale(-REACH, REACH), Scale(-REACH, REACH), ("x, forward [m]", "y, left [m]"), bar),
    )


def scan_in_image(scans: Mapping[str, Scan]) -> Picture | None:
    """Draw the camera image, and the depth of each row's scan over it; None without an image and its calibration."""
    seen = {label: scan for label, scan in scans.items() if scan.image is not None and scan.calibration is not None}
    if not seen:
        return None
    image = next(iter(seen.values())).image
    assert image is not None
    views = {"camera image": image} | dict(_overlay(scan, label) for label, scan in seen.items())
    number = next(iter(seen.values())).number
    return Picture(
        "image",
        f"Frame {number} in the camera image",
        "The camera image, and over it the depth of the points of each input; points hidden behind nearer ones are "
        "left out.",
        f"Camera image of frame {number}, and the depth of the points of {', '.join(seen)} over it.",
        _below(views, image.shape[0] / image.shape[1]),
    )


def maps_beside(maps: Mapping[str, Points]) -> Picture:
    """Draw the maps from above on one scale (Fig. 6 of the paper)."""
    some = np.concatenate([points.xyz[:: max(1, len(points.xyz) // SAMPLED)] for points in maps.values()])
    low, high = np.quantile(some, (0.002, 0.998), axis=0)
    lowest, highest = np.quantile(some[:, 2], (LOWEST, HIGHEST)).tolist()
    limits = (lowest, max(highest, lowest + 1e-3))
    views = {label: partial(_map_view, points.xyz, limits) for label, points in maps.items()}
    x, y = (Scale(low[axis] - 5, high[axis] + 5) for axis in (0, 1))
    return Picture(
        "maps",
        "Maps from above" if len(maps) > 1 else "Map from above",
        "Height by colour, on one scale, all points, as in Fig. 6 of the paper by Yue et al.",
        f"Maps of {', '.join(maps)} from above, next to each other.",
        _beside(views, x, y, ("x [m]", "y [m]"), (HEIGHT_MAP, *limits, "height z [m]")),
    )


def on_dark(drawing: Drawing) -> Drawing:
    """Return a picture on a dark ground with pale text."""
    return drawing.recoloured(DARK, INK, MEASURED)


def _scan_view(scan: Scan, axes: Axes) -> Array:
    """Predicted points by sigma, and the measured ones above them."""
    cloud = scan.cloud.select(np.abs(scan.cloud.xyz[:, :2]).max(axis=1, initial=0) < REACH)
    new, old = cloud.select(~cloud.measured), cloud.select(cloud.measured)
    image = _dark(axes)
    _dots(image, axes, new.xyz, colours_of(new.sigma, 0, MOST_SIGMA, SIGMA_MAP))
    _dots(image, axes, old.xyz, np.tile(np.array(rgb(MEASURED), np.uint8), (len(old), 1)))
    return image


def _map_view(xyz: Array, limits: tuple[float, float], axes: Axes) -> Array:
    image = _dark(axes)
    _dots(image, axes, xyz, colours_of(xyz[:, 2], *limits, HEIGHT_MAP))
    return image


def _dark(axes: Axes) -> Array:
    """A dark image (H, W, 3) of a view from above."""
    height, width = (
        max(1, round(PIXELS * side / max(axes.box.width, axes.box.height)))
        for side in (axes.box.height, axes.box.width)
    )
    return np.full((height, width, 3), rgb(DARK), np.uint8)


def _dots(image: Array, axes: Axes, xyz: Array, colours: Array) -> None:
    """Draw points (N, 3) from above, a pixel each, the highest of a pixel."""
    height, width = image.shape[:2]
    column = np.floor(axes.x.share(xyz[:, 0]) * width).astype(np.int32)
    row = np.floor((1 - axes.y.share(xyz[:, 1])) * height).astype(np.int32)
    order = highest_last(xyz[:, 2])
    order = order[((column >= 0) & (column < width) & (row >= 0) & (row < height))[order]]
    image[row[order], column[order]] = colours[order]


def _overlay(scan: Scan, label: str) -> tuple[str, Array]:
    """Title, and the darkened image with the depth of the points."""
    assert scan.image is not None
    assert scan.calibration is not None
    pixels, depth = project(scan.cloud.xyz, scan.calibration)
    shown = visible(pixels, depth, scan.image.shape)
    order = np.argsort(-depth[shown])
    column, row = np.rint(pixels[shown][order] - DOT / 2).astype(np.int32).T
    image = np.repeat((scan.image.mean(axis=2, keepdims=True) * DIMMED).astype(np.uint8), 3, axis=2)
    colours = colours_of(-depth[shown][order], -FAR, -NEAR, DEPTH_MAP)
    for down, right in np.ndindex(DOT, DOT):
        image[np.clip(row + down, 0, len(image) - 1), np.clip(column + right, 0, image.shape[1] - 1)] = colours
    return f"{label}: {shown.sum():,} points in the image", image


def _beside(views: Mapping[str, View], x: Scale, y: Scale, titles: tuple[str, str], bar: Bar | None) -> Drawing:
    """Views from above next to each other, on one scale."""
    width = WIDTH if len(views) > 1 else SINGLE
    left = EDGE + 1.6 * LABEL + GAP + 3 * SMALL
    gap = 2 * GAP
    right = width - EDGE - (gap + colour_bar_width(*bar[1:3], SINGLE) if bar else 0)
    aspect = float(np.clip((y.high - y.low) / (x.high - x.low), MIN_ASPECT, MAX_ASPECT))
    side = (right - left - gap * (len(views) - 1)) // len(views)
    bottom = EDGE + ABOVE + round(aspect * side)
    drawing = Drawing(width, round(bottom + GAP + 3 * LABEL + EDGE))
    for k, (title, view) in enumerate(views.items()):
        box = Box(left + k * (side + gap), EDGE + ABOVE, left + k * (side + gap) + side, bottom)
        axes = equal_scales(box, x, y)
        drawing.shapes.append(Image(box, view(axes)))
        drawing.shapes.append(Text(box.left, EDGE + TITLE, title, INK, TITLE))
        drawing.shapes.extend(axes.x_labels(axes.x_ticks(), titles[0], SMALL))
        if k == 0:
            drawing.shapes.extend(axes.y_labels(axes.y.ticks(side / X_TICK), titles[1], EDGE + LABEL / 2, SMALL))
    if bar:
        place = Box(right + gap, EDGE + ABOVE, right + gap + BAR, bottom)
        drawing.shapes.extend(colour_bar(place, *bar))
    return drawing


def _below(views: Mapping[str, Array], aspect: float) -> Drawing:
    """Camera images below each other, with a bar of the depth's colours."""
    bar = GAP + colour_bar_width(NEAR, FAR, SINGLE)
    side = min(SINGLE, MAX_HEIGHT / (len(views) * aspect))
    height = ABOVE + round(aspect * side)
    drawing = Drawing(round(side + bar + 2 * EDGE), round(len(views) * height + GAP * (len(views) - 1) + 2 * EDGE))
    for k, (title, image) in enumerate(views.items()):
        top = EDGE + k * (height + GAP)
        drawing.shapes.append(Text(EDGE, top + TITLE, title, INK, TITLE))
        drawing.shapes.append(Image(Box(EDGE, top + ABOVE, EDGE + side, top + height), image, photograph=True))
    middle, right = drawing.height / 2, EDGE + side + GAP
    place = Box(right, 0.45 * middle, right + BAR, 1.55 * middle)
    drawing.shapes.extend(colour_bar(place, DEPTH_MAP, NEAR, FAR, "depth [m]", reverse=True))
    return drawing
