"""Plot of a trajectory from above with its ground truth, and of the position error over the travelled distance."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from eval.alignment import alignment_transform
from eval.evaluation import pair_up
from eval.trajectory import distances
from slam.data.body_frame import body_frame
from slam.data.cloud import Array
from slam.data.drawing.axes import GAP, LABEL, Axes, Scale
from slam.data.drawing.fonts import text_width
from slam.data.drawing.raster import save_png
from slam.data.drawing.shapes import POINT, Area, Box, Drawing, Line, Shape, Text
from slam.data.plot_style import BLUE, GREY, INK, VERMILION
from slam.data.pose_files import read_poses

#: Ground truth is drawn as a broad band under the estimate.
ESTIMATE, TRUTH, ERROR = BLUE, GREY, VERMILION

WIDTH, ERROR_HEIGHT, EDGE = 1200, 200, 14  # pixels: the figure, the error's axes, around what is drawn
TITLE = 13 * POINT
SAMPLE = 50  # pixels of a line in the legend

#: Limits of the map: minimum and maximum ratio of height to width, and minimum width [m].
MIN_ASPECT, MAX_ASPECT, MIN_SPAN = 0.3, 0.95, 4.0


def plot_trajectory(
    path_png: Path,
    estimate: Array,
    reference: Array | None,
    title: str,
    stamps: Array | None = None,
    reference_stamps: Array | None = None,
) -> None:
    """Draw a trajectory from above with its reference, and the position error over the travelled distance.

    The estimate is aligned by SE(3) Umeyama. Without a reference it is drawn alone and unaligned. Camera-0 trajectories
    are drawn in x and z, others in x and y.

    Args:
        path_png: The file to write, atomically.
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (M, 4, 4) [m] of the same body, or None.
        title: Title of the figure.
        stamps: Stamps of the estimate (N,) [s].
        reference_stamps: Stamps of the reference (M,) [s]. With both, poses are associated as in `evaluate_poses`.

    Raises:
        InputError: The poses cannot be associated.
    """
    error = None
    if reference is not None:
        e, g = pair_up(estimate, reference, stamps, reference_stamps)
        T, _ = alignment_transform(e, g, "aligned")
        estimate = T @ estimate
        error = np.linalg.norm((T @ e)[:, :3, 3] - g[:, :3, 3], axis=1)
    axes = (0, 2) if body_frame(estimate) == "camera" else (0, 1)
    estimate_xy = estimate[:, axes, 3]
    reference_xy = None if reference is None else reference[:, axes, 3]
    center, span = _window(estimate_xy if reference_xy is None else np.concatenate([estimate_xy, reference_xy]))

    names = tuple(f"{'xyz'[axis]} [m]" for axis in axes)
    left = round(EDGE + 1.6 * LABEL + text_width("\N{MINUS SIGN}0000", LABEL) + GAP)
    right, top = WIDTH - EDGE, EDGE + 1.6 * TITLE + 1.7 * LABEL
    map_box = Box(left, top, right, top + round((right - left) * span[1] / span[0]))
    x, y = (Scale(center[axis] - span[axis] / 2, center[axis] + span[axis] / 2) for axis in (0, 1))
    shapes = [
        Text(left, EDGE + TITLE, title, INK, TITLE, bold=True),
        *_map(Axes(map_box, x, y), names, estimate_xy, reference_xy, error),
    ]
    bottom = map_box.bottom
    if error is not None:
        above = bottom + GAP + 4 * LABEL
        bottom = above + ERROR_HEIGHT
        shapes += _error(Box(left, above, right, bottom), distances(g), error)
    save_png(Drawing(WIDTH, round(bottom + GAP + 3 * LABEL + EDGE), shapes), path_png)


def plot_run(folder: Path, title: str | None = None) -> Path:
    """Draw the trajectory of a run, with its ground truth if there is any, into trajectory.png in its folder.

    Args:
        folder: A run folder with trajectory_tum.txt, and ground_truth_tum.txt if there is ground truth.
        title: Title of the figure; by default the folder's name.

    Returns:
        The path of the figure.

    Raises:
        InputError: A file cannot be read, or the poses cannot be associated.
    """
    stamps, estimate = read_poses(folder / "trajectory_tum.txt", "xyzw")
    truth_file = folder / "ground_truth_tum.txt"
    truth_stamps, truth = read_poses(truth_file, "xyzw") if truth_file.is_file() else (None, None)
    picture = folder / "trajectory.png"
    plot_trajectory(picture, estimate, truth, title or folder.resolve().name, stamps, truth_stamps)
    return picture


def _window(xy: Array) -> tuple[Array, Array]:
    """Centre (2,) and extent (2,) [m] of a map around points (N, 2), with a margin and within the aspect limits."""
    low, high = xy.min(axis=0), xy.max(axis=0)
    width, height = 1.12 * (high - low)
    width = max(width, height / MAX_ASPECT, MIN_SPAN)
    height = max(height, width * MIN_ASPECT)
    return (low + high) / 2, np.array([width, height])


def _map(
    axes: Axes, titles: tuple[str, ...], estimate: Array, reference: Array | None, error: Array | None
) -> list[Shape]:
    x_ticks, y_ticks = axes.x_ticks(), axes.y_ticks(1.3)
    shapes: list[Shape] = [axes.grid(x_ticks, y_ticks)]
    label = "estimate"
    if error is not None:
        label += f", aligned by SE(3) Umeyama (ATE {_metres(float(np.sqrt((error**2).mean())))} rmse)"
    lines = [(estimate, ESTIMATE, 4.0, label)]
    if reference is not None:
        lines.insert(0, (reference, TRUTH, 11.5, "ground truth"))
    at, height = axes.box.left, axes.box.top - LABEL
    for xy, colour, width, name in lines:
        shapes.append(Line(axes.at(*xy.T), colour, width, box=axes.box))
        shapes.append(Line(np.array([[at + 4, height], [at + SAMPLE - 4, height]]), colour, width))
        shapes.append(Text(at + SAMPLE + GAP, height, name, INK, middle=True))
        at += SAMPLE + 4 * GAP + text_width(name, LABEL)
    start = axes.at(*estimate[:1].T)
    shapes += [Line(start, INK, 20), Line(start, "#FFFFFF", 13)]
    shapes.append(Text(start[0, 0] + 16, start[0, 1] - 16, "start", INK))
    return [*shapes, *axes.x_labels(x_ticks, titles[0]), *axes.y_labels(y_ticks, titles[1], EDGE + LABEL / 2)]


def _error(box: Box, travelled: Array, error: Array) -> list[Shape]:
    """Error over the travelled distance, or over the frames of a standing vehicle; in centimetres below a metre."""
    stood = travelled[-1] < MIN_SPAN
    along, label = (np.arange(len(travelled)), "frame") if stood else (travelled, "travelled distance [m]")
    factor, unit = (1.0, "m") if error.max() >= 1 else (100.0, "cm")
    axes = Axes(box, Scale(0.0, float(along[-1])), Scale(0.0, max(1.1 * factor * float(error.max()), 1e-2)))
    curve = axes.at(along, factor * error)
    x_ticks, y_ticks = axes.x_ticks(), axes.y_ticks()
    below = axes.at(along[[-1, 0]], np.zeros(2))
    return [
        axes.grid(x_ticks, y_ticks),
        Area(np.concatenate([curve, below]), ERROR, 0.15),
        Line(curve, ERROR, 3.0),
        *axes.x_labels(x_ticks, label),
        *axes.y_labels(y_ticks, f"error [{unit}]", EDGE + LABEL / 2),
    ]


def _metres(value: float) -> str:
    return f"{100 * value:.1f} cm" if value < 1 else f"{value:.2f} m"
