"""Picture of a map from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from slam.data.cloud import Array, PointCloud
from slam.data.from_above import highest_last
from slam.data.plot_style import margins, save_png

MAX_PIXELS = 1600  # along the longer side of the map
MIN_PIXEL = 0.1  # m per pixel: with finer pixels a map of 0.2 m voxels would have holes
BACKGROUND = 16
CELL = 2.0  # m, and at least two pixels: squares that share their nearest trajectory position
AT_ONCE = 1 << 17  # points that are coloured together: bounds the memory
SAMPLED = 200_000  # points that the limits of the map are computed from, about
LOWEST, HIGHEST = -2.5, 6.0  # m above the sensor's path: limits of the colour scale
RED, DPI = "#FF3B30", 150
LEFT, RIGHT, BELOW, ABOVE = 0.9, 0.2, 0.6, 0.15  # inches around the map


def map_png(cloud: PointCloud, trajectory: Array, path: Path) -> None:
    """Draw a map and the trajectory from above, with a grid in metres.

    Points have their colour from the camera, or else a colour for their height above the trajectory; each pixel shows
    its highest point. For an empty map only the trajectory is drawn.

    Args:
        cloud: The map in the world frame.
        trajectory: Positions (N, 3) of the sensor in the world frame [m].
        path: The PNG to write, atomically.
    """
    from matplotlib.figure import Figure  # half a second of import, at the end of a run only

    corners = np.concatenate([_extent(cloud.xyz[:, :2]), trajectory[:, :2].reshape(-1, 2)])
    low, high = np.floor(corners.min(axis=0)) - 5, np.ceil(corners.max(axis=0)) + 5
    pixel = max(MIN_PIXEL, float((high - low).max()) / MAX_PIXELS)
    width, height = np.ceil((high - low) / pixel).astype(int).tolist()
    picture = _drawn(cloud, trajectory, low, pixel, width, height)

    figure = Figure((LEFT + width / DPI + RIGHT, BELOW + height / DPI + ABOVE), DPI, facecolor="white")
    axes = figure.add_subplot()
    margins(figure, LEFT, RIGHT, BELOW, ABOVE)
    edges = (low[0], low[0] + width * pixel, low[1], low[1] + height * pixel)
    axes.imshow(picture, origin="lower", extent=edges, interpolation="none", aspect="auto")  # its pixels are the file's
    axes.plot(*trajectory[:, :2].T, color=RED, linewidth=0.9, label="trajectory")
    axes.plot(*trajectory[:1, :2].T, "o", color=RED, markersize=4)
    axes.grid(color="white", alpha=0.25, linewidth=0.5)
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=edges[:2], ylim=edges[2:])
    axes.legend(loc="upper right", fontsize="small")
    save_png(figure, path, DPI)


def _extent(xy: Array) -> Array:
    """Lower and upper corner (2, 2) of the points without outliers; (0, 2) for no points."""
    return np.quantile(xy[:: max(1, len(xy) // SAMPLED)], (0.0005, 0.9995), axis=0) if len(xy) else np.zeros((0, 2))


def _drawn(cloud: PointCloud, trajectory: Array, low: Array, pixel: float, width: int, height: int) -> Array:
    """Image (H, W, 4) uint8 RGBA, as matplotlib needs it, first row at the lowest y."""
    picture = np.full((height * width, 4), (*3 * [BACKGROUND], 255), np.uint8)
    heights = _Heights(low, np.array([width, height]) * pixel, trajectory, max(CELL, 2 * pixel))
    shown = _shown(cloud, low, pixel, width, height)
    for start in range(0, len(shown), AT_ONCE):
        points = cloud.select(shown[start : start + AT_ONCE])
        picture[_pixels(points.xyz, low, pixel, width), :3] = _colours(points, heights)
    empty = np.ones(height * width, bool)
    empty[_pixels(cloud.xyz[shown], low, pixel, width)] = False
    return _without_holes(picture.reshape(height, width, 4), empty.reshape(height, width))


def _shown(cloud: PointCloud, low: Array, pixel: float, width: int, height: int) -> Array:
    """The highest point of each pixel, for those that have any."""
    order = highest_last(cloud.xyz[:, 2])
    column, row = np.floor((cloud.xyz[order, :2] - low) / pixel).astype(np.int32).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    highest = np.full(height * width, -1, np.int64)
    highest[(row * width + column)[inside]] = order[inside]
    return highest[highest >= 0]


def _pixels(xyz: Array, low: Array, pixel: float, width: int) -> Array:
    """Numbers (N,) of the pixels of points (N, 3) inside the picture, row by row."""
    column, row = ((xyz[:, :2] - low) / pixel).astype(np.int64).T
    return np.asarray(row * width + column)


def _without_holes(picture: Array, empty: Array) -> Array:
    """Fill `empty` (H, W) pixels from the one below or to the left: averaged points do not fall into every pixel."""
    for axis in (0, 1):
        filled = empty & ~np.roll(empty, 1, axis)
        row, column = filled.nonzero()
        picture[row, column] = picture[row - (axis == 0), column - (axis == 1)]
        empty = empty & ~filled
    return picture


def _colours(cloud: PointCloud, heights: _Heights) -> Array:
    """Colours (N, 3) uint8 of the points."""
    from matplotlib import colormaps

    palette = (255 * colormaps["viridis"](np.linspace(0.2, 1.0, 256))[:, :3]).astype(np.uint8)
    share = np.clip((heights(cloud.xyz) - LOWEST) / (HIGHEST - LOWEST), 0, 1)
    light = 0.6 + 0.4 * np.sqrt(np.clip(cloud.intensity, 0, 1))  # intensity makes road markings visible
    colours = (palette[(255 * share).astype(np.uint8)] * light[:, None]).astype(np.uint8)
    if cloud.colour is not None:
        seen = cloud.colour.any(axis=1)
        colours[seen] = cloud.colour[seen]
    return np.asarray(colours)


class _Heights:
    """Heights above the nearest trajectory position, which is looked up per square of `size` [m]."""

    def __init__(self, low: Array, extent: Array, trajectory: Array, size: float) -> None:
        self._size, self._corner = size, low
        columns, self._rows = np.ceil(extent / size).astype(int) + 1
        middle = (np.stack(np.divmod(np.arange(columns * self._rows), self._rows), axis=1) + 0.5) * size + low
        self._base = trajectory[cKDTree(trajectory[:, :2]).query(middle)[1], 2].astype(np.float32)

    def __call__(self, xyz: Array) -> Array:
        """Heights (N,) [m] of points (N, 3)."""
        column, row = ((xyz[:, :2] - self._corner) / self._size).astype(np.int64).T
        return np.asarray(xyz[:, 2] - self._base[column * self._rows + row])
