"""Revisits of drives, and how a run detected them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from eval.alignment import alignment_transform
from eval.evaluation import evaluate_poses
from slam.data import se3
from slam.data.cloud import Array
from slam.data.plot_style import BLUE, GREEN, ORANGE, PURPLE, VERMILION, save_png, tidy
from slam.data.pose_files import tum_text
from slam.graph.back_end import BackEnd
from slam.graph.ledger import LoopCandidate, LoopRecord
from slam.recorded_odometry import RecordedOdometry
from slam.run import Run

WRONG = 3.0  # m that a loop is off by
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE)


def revisits(places: Array, since: Array, near: float, ago: float) -> list[int]:
    """Find the places (K, 4, 4) within `near` [m] of one more than `ago` before, by `since` (K,), increasing.

    `since` is the distance travelled [m] or the number of the place.
    """
    position = places[:, :3, 3]
    found = cKDTree(position).query_ball_point(position, near)
    return [k for k, others in enumerate(found) if any(since[k] - since[other] > ago for other in others)]


def drifting(poses: Array) -> Array:
    """Poses with drift added: 1 % of the distance travelled and 1 degree per 100 m, in a direction drawn once."""
    rng = np.random.default_rng(5)
    axis, aside = rng.normal(size=3) * [0.3, 0.3, 1], rng.normal(size=3)
    turn, move = np.deg2rad(0.01) * axis / np.linalg.norm(axis), 0.01 * aside / np.linalg.norm(aside)
    result = [poses[0]]
    for motion in se3.inverse(poses[:-1]) @ poses[1:]:
        way = float(np.linalg.norm(motion[:3, 3]))
        result.append(se3.normalized(result[-1] @ motion @ se3.exp(way * np.concatenate([turn, move]))))
    return np.array(result)


def as_recorded(stamps: Array, poses: Array) -> RecordedOdometry:
    """Poses (N, 4, 4) at stamps (N,) as if another odometry had written them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "odometry.txt"
        path.write_text(tum_text(stamps, poses))
        return RecordedOdometry(path, len(poses))


def loop_figures(run: Run, truth: Array, asked: Sequence[int], near: float) -> dict[str, Any]:
    """ATE before and after, loops found and wrong, and how well the candidates alone do.

    truth  (N, 4, 4) of all frames;  asked  the keyframes that are revisits, within `near` [m] of an earlier place
    """
    mapping = run.mapping
    assert mapping is not None
    places = truth[mapping.keyframes.indices]
    loops = [record.candidate for record in mapping.ledger if record.status == "accepted"]
    errors = [
        float(np.linalg.norm((se3.inverse(loop.pose) @ se3.inverse(places[loop.i]) @ places[loop.j])[:3, 3]))
        for loop in loops
    ]
    trajectories = (run.odometry_poses, run.poses, with_true_loops(run, truth))
    before, after, ideal = (evaluate_poses(poses, truth).ate.aligned.rmse for poses in trajectories)
    return {
        "ate_before": before, "ate_after": after, "ate_true_loops": ideal,
        "height_after": height_error(run.poses, truth), "revisits": len(asked),
        "found": len(set(asked) & {loop.j for loop in loops}), "loops": len(loops),
        "wrong": sum(error > WRONG for error in errors), "worst": max(errors, default=0.0),
        "candidates": len(mapping.ledger), "detection": detection(mapping.ledger, places, asked, near),
    }  # fmt: skip


def with_true_loops(run: Run, truth: Array) -> Array:
    """Poses (N, 4, 4) if the run's loops were just where the truth has them: the best that these loops can do."""
    mapping = run.mapping
    assert mapping is not None
    if mapping.loops == 0:
        return run.odometry_poses
    places, back_end = truth[mapping.keyframes.indices], BackEnd()
    for edge in mapping.graph.edges:
        if edge.j == edge.i + 1:
            back_end.add_odometry(edge.pose, edge.covariance)
        else:
            true = se3.normalized(se3.inverse(places[edge.i]) @ places[edge.j])
            back_end.add_loop(LoopCandidate(edge.i, edge.j, true), edge.covariance)
    back_end.settle()
    poses = mapping.keyframes.poses[0] @ back_end.poses()
    return replace(mapping, poses=poses).corrected(run.odometry_poses)


def height_error(poses: Array, truth: Array) -> float:
    """The part of the aligned ATE [m] along the truth's z axis."""
    transform, _ = alignment_transform(poses, truth, "aligned")
    return float(np.sqrt(np.mean((transform @ poses - truth)[:, 2, 3] ** 2)))


def detection(ledger: Sequence[LoopRecord], places: Array, asked: Sequence[int], near: float) -> dict[str, Any]:
    """Precision and recall of the descriptors alone, where the threshold on their distance is a multiple of 0.01.

    Each keyframe answers with its first candidate, if its distance is below the threshold; right is one within `near`
    [m] of the query, by the places (K, 4, 4). The ledger has candidates up to the loop search's own threshold.
    `recall_without_error` is that at the loosest threshold, of any value, with all answers right.
    """
    first: dict[int, LoopRecord] = {}
    for record in ledger:
        first.setdefault(record.candidate.j, record)
    answers = sorted((record.candidate for record in first.values()), key=lambda one: one.distance)
    right = [float(np.linalg.norm((places[one.i] - places[one.j])[:3, 3])) < near for one in answers]
    hits = [good and one.j in set(asked) for good, one in zip(right, answers, strict=True)]
    precision = np.cumsum(right) / np.arange(1, len(right) + 1)
    recall = np.cumsum(hits) / max(len(asked), 1)
    threshold = np.arange(1, 101) / 100
    upto = np.searchsorted(np.round([one.distance for one in answers], 4), threshold, side="right") - 1
    some = np.flatnonzero((upto >= 0) & np.diff(upto, prepend=-1).astype(bool))
    return {
        "recall_without_error": float(recall[precision == 1].max(initial=0)),
        "threshold": threshold[some].tolist(),
        "recall": recall[upto[some]].round(4).tolist(),
        "precision": precision[upto[some]].round(4).tolist(),
    }


def draw_detection(panels: Mapping[str, Mapping[str, dict[str, Any]]], path: Path) -> None:
    """Draw precision over recall, one panel per drive: a line for the candidates of each run, a dot for its loops.

    Args:
        panels: [drive][run], figures of `loop_figures`.
        path: The PNG to write.
    """
    figure = Figure(figsize=(4.2 * len(panels), 4.2), layout="constrained")
    for axes, (drive, runs) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True):
        _panel(axes, drive, runs)
    save_png(figure, path, dpi=120)


def _panel(axes: Axes, drive: str, runs: Mapping[str, dict[str, Any]]) -> None:
    for colour, (name, figures) in zip(COLOURS, runs.items(), strict=False):
        curve, loops = figures["detection"], figures["loops"]
        axes.plot(curve["recall"], curve["precision"], color=colour, linewidth=1.2, label=name)
        if loops:
            recall, precision = figures["found"] / max(figures["revisits"], 1), 1 - figures["wrong"] / loops
            axes.plot(recall, precision, "o", color=colour, clip_on=False, zorder=3)
    axes.set_title(f"{drive}\nline: candidates alone, dot: verified", fontsize=10)
    axes.set(xlabel="recall", ylabel="precision", xlim=(0, 1), ylim=(0, 1.02))
    tidy(axes)
    axes.legend(loc="lower left", fontsize="small", frameon=False)
