"""Plot of a trajectory from above with its ground truth, and of the position error over the travelled distance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eval.alignment import alignment_transform
from eval.evaluation import pair_up
from eval.trajectory import distances
from slam.data.body_frame import body_frame
from slam.data.cloud import Array
from slam.data.plot_style import BLUE, GREY, INK, VERMILION, fitting, margins, save_png, tidy
from slam.data.pose_files import read_poses

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Ground truth is drawn as a broad band under the estimate.
ESTIMATE, TRUTH, ERROR = BLUE, GREY, VERMILION

#: Sizes [inches]: width of the figure, height of the error's axes, space for labels and around the map.
WIDTH, ERROR_HEIGHT, BETWEEN = 8.0, 1.35, 0.55
LEFT, RIGHT, BELOW, ABOVE = 0.9, 0.25, 0.55, 0.7

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
    from matplotlib.figure import Figure

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

    map_height = (WIDTH - LEFT - RIGHT) * span[1] / span[0]
    below = 0.0 if error is None else BETWEEN + ERROR_HEIGHT
    figure = Figure((WIDTH, ABOVE + map_height + below + BELOW))
    if error is None:
        top = figure.subplots()
        margins(figure, LEFT, RIGHT, BELOW, ABOVE)
    else:
        top, bottom = figure.subplots(2, 1, height_ratios=[map_height, ERROR_HEIGHT])
        margins(figure, LEFT, RIGHT, BELOW, ABOVE, gap_y=BETWEEN)
        _draw_error(bottom, distances(g), error)
    _draw_map(top, estimate_xy, reference_xy, error)
    top.set_xlim(center[0] - span[0] / 2, center[0] + span[0] / 2)
    top.set_ylim(center[1] - span[1] / 2, center[1] + span[1] / 2)
    top.set_xlabel(f"{'xyz'[axes[0]]} [m]")
    top.set_ylabel(f"{'xyz'[axes[1]]} [m]")
    top.set_title(
        title, loc="left", y=1.0, color=INK, fontsize=fitting(title, 13, WIDTH - 1), fontweight="bold", pad=32
    )
    save_png(figure, path_png)


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


def _draw_map(axes: Axes, estimate: Array, reference: Array | None, error: Array | None) -> None:
    if reference is not None:
        axes.plot(*reference.T, color=TRUTH, linewidth=5.5, solid_capstyle="round", label="ground truth")
    label = "estimate"
    if error is not None:
        label += f", aligned by SE(3) Umeyama (ATE {_metres(float(np.sqrt((error**2).mean())))} rmse)"
    axes.plot(*estimate.T, color=ESTIMATE, linewidth=1.8, label=label)
    start = estimate[0]
    axes.plot(*start, "o", markersize=8, color="white", markeredgecolor=INK, markeredgewidth=1.6, zorder=4)
    behind = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
    axes.annotate("start", start, xytext=(8, 8), textcoords="offset points", color=INK, fontsize=10, bbox=behind)
    axes.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncols=2, frameon=False, fontsize=10, borderaxespad=0.2)
    tidy(axes)


def _draw_error(axes: Axes, travelled: Array, error: Array) -> None:
    """Error over the travelled distance, or over the frames of a standing vehicle; in centimetres below a metre."""
    stood = travelled[-1] < MIN_SPAN
    along, label = (np.arange(len(travelled)), "frame") if stood else (travelled, "travelled distance [m]")
    factor, unit = (1.0, "m") if error.max() >= 1 else (100.0, "cm")
    axes.fill_between(along, factor * error, color=ERROR, alpha=0.15, linewidth=0)
    axes.plot(along, factor * error, color=ERROR, linewidth=1.5)
    axes.set_xlim(0, along[-1])
    axes.set_ylim(0, max(1.1 * factor * float(error.max()), 1e-2))
    axes.set_xlabel(label)
    axes.set_ylabel(f"error [{unit}]")
    tidy(axes)


def _metres(value: float) -> str:
    return f"{100 * value:.1f} cm" if value < 1 else f"{value:.2f} m"
