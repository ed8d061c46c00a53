"""Charts of the run itself: what happened to each frame, and where the time goes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from eval.report.chart import Bars, Chart, Curve, Panel, Symbol
from eval.report.content import Report
from eval.runs import Frames, RunDetails
from eval.text import number
from slam.data.covariance_file import read_covariances

#: Symbol of each status that is not the usual one.
SYMBOLS: dict[str, Symbol] = {"retried": "circle", "degenerate": "triangle", "failed": "x"}
#: Stages of run.json with the names of their bars; the first three are per frame, the others per keyframe or frame.
STAGES = {
    "load": "read",
    "front_end": "front end",
    "odometry": "odometry",
    "map": "map",
    "loops": "loops",
    "back_end": "back end",
}


def health_charts(report: Report) -> tuple[list[Chart], list[Chart]]:
    """Return the charts of frames and those of run times; none for trajectories alone."""
    return list(_frames(report)), list(_timings(report))


def _frames(report: Report) -> Iterator[Chart]:
    runs = report.runs
    if not runs:
        return
    inliers, points, unobserved, sigma, time = ([] for _ in range(5))
    status: list[Curve] = []
    for k, (row, run) in enumerate(runs):
        frames, colour = run.frames, report.colours[row.label]
        status += _unusual(row.label, frames, float(k), colour)
        inliers.append(Curve(frames.numbers, frames.inlier_ratio, row.label, colour, width=1.5))
        points.append(Curve(frames.numbers, frames.points / 1000, row.label, colour, width=1.5))
        unobserved.append(Curve(frames.numbers, frames.unobserved, row.label, colour, width=1.5))
        time.append(Curve(frames.numbers, frames.milliseconds["odometry"], row.label, colour, width=1.0))
        if (deviations := _position_sigma(run)) is not None:
            sigma.append(Curve(frames.numbers, deviations, row.label, colour, width=1.5))
    panels = [
        Panel("inlier ratio", inliers),
        Panel("points [thousand]", points, from_zero=True),
        Panel("odometry [ms]", time, log=True),
    ]
    degenerate = any(curve.y.any() for curve in unobserved)
    if degenerate:
        panels.insert(1, Panel("unobserved", unobserved, from_zero=True))
    if sigma:
        panels.insert(1, Panel("position sigma [m]", sigma, from_zero=True))
    if status:
        panels.insert(0, Panel("status", status, ticks=[row.label for row, _ in runs]))
    counts = {row.label: Counter(run.frames.status) for row, run in runs}
    worst = {row.label: float(np.nanmin(run.frames.inlier_ratio, initial=1.0)) for row, run in runs}
    yield Chart(
        "health",
        "Health, frame by frame",
        "Inlier ratio: share of the matched points that fit the local map. Points: passed to the odometry by the front "
        "end. "
        + ("Position sigma: largest standard deviation of the position, from the pose's covariance. " if sigma else "")
        + _consistency(report)
        + ("Unobserved: directions of motion that the scan did not constrain. " if degenerate else "")
        + ("Status: frames that were not simply registered." if status else "All frames were registered at once."),
        "; ".join(
            f"{label}: {_words(found)}, lowest inlier ratio {worst[label]:.2f}" for label, found in counts.items()
        ),
        "frame",
        panels,
    )


def _unusual(label: str, frames: Frames, height: float, colour: str) -> Iterator[Curve]:
    """A point for each frame that was not simply registered, at a height of the panel."""
    for name, symbol in SYMBOLS.items():
        at = frames.numbers[np.array(frames.status) == name]
        if len(at):
            yield Curve(at, np.full(len(at), height), f"{label}, {name}", colour, width=0, symbol=symbol)


def _consistency(report: Report) -> str:
    """Whether the covariances fit the errors, where both are known."""
    listed = ", ".join(f"{row.label} {number(run.nees, 2)}" for row, run in report.runs if run.nees is not None)
    return f"NEES of the poses (1 is consistent, below 1 is cautious): {listed}. " if listed else ""


def _timings(report: Report) -> Iterator[Chart]:
    runs = report.runs
    times = {row.label: run.report["timings_ms"] for row, run in runs}
    stages = {stage: name for stage, name in STAGES.items() if any(stage in found for found in times.values())}
    if not stages:
        return
    bars = [
        Bars(np.array([found.get(stage, {}).get("median", np.nan) for stage in stages]), label, report.colours[label])
        for label, found in times.items()
    ]
    online = {
        label: sum(found.get(stage, {}).get("median", 0.0) for stage in ("front_end", "odometry"))
        for label, found in times.items()
    }
    yield Chart(
        "timings",
        "Time by stage",
        "Median milliseconds on the machine of the run. Reading, front end and odometry are per frame, one after the "
        "other; map, loops and back end run in parallel with them, loops and back end once per keyframe.",
        "; ".join(f"{label}: front end and odometry {ms:.1f} ms per frame" for label, ms in online.items()),
        "",
        [Panel("median [ms]", bars=bars, from_zero=True)],
        categories=tuple(stages.values()),
    )


def _position_sigma(run: RunDetails) -> np.ndarray | None:
    """Largest standard deviation (N,) [m] of each position; None without the covariances."""
    path = run.folder / "trajectory_covariance.csv"
    if not path.is_file():
        return None
    covariances = read_covariances(path)[1]
    largest = np.linalg.eigvalsh(covariances[:, 3:, 3:])[:, -1]
    return np.sqrt(np.maximum(largest, 0.0))


def _words(counts: Counter[str]) -> str:
    return ", ".join(f"{counts[name]} {name}" for name in ("registered", *SYMBOLS) if counts[name])
