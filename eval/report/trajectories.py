"""Charts of the trajectories: from above with loops, error along the path, drift by segment length, height."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from eval.kitti_metric import drift_by_length
from eval.loops import FALSE_BEYOND
from eval.report.chart import TRUTH, Chart, Curve, Panel
from eval.report.content import Pairs, Report
from eval.report.loops import closures
from eval.runs import Row
from slam.data import se3
from slam.data.body_frame import body_frame
from slam.data.cloud import Array


def trajectory_charts(report: Report) -> list[Chart]:
    """Return the charts that can be drawn: without common instants with the reference there is only the map."""
    pairs = {row.label: report.pairs(row.track) for row in report.rows}
    found = {label: pair for label, pair in pairs.items() if pair}
    charts = [_from_above(report, found)]
    compared = [row for row in report.rows if row.label in found and row.label != report.reference[0]]
    if compared:
        charts.append(_error(report, compared, found))
        segments = _segments(report, compared, found)
        charts += [segments] if segments.panels[0].curves else []
    return [*charts, *([_height(report, found)] if found else [])]


def _from_above(report: Report, pairs: dict[str, Pairs]) -> Chart:
    name, reference = report.reference
    axes = (0, 2) if body_frame(reference.poses) == "camera" else (0, 1)
    curves = [_band(reference.poses[:, axes[0], 3], reference.poses[:, axes[1], 3], name)] if report.truth else []
    for row in report.rows:
        pair, colour = pairs.get(row.label), report.colours[row.label]
        T = pair.aligned if pair and row.track is not reference else np.eye(4)
        if row.run and any(loop.accepted for loop in row.run.loops):
            x, y = (T @ row.run.odometry.poses)[:, axes, 3].T
            curves.append(Curve(x, y, f"{row.label}, odometry", colour, "dot", 1.2))
        x, y = (T @ row.track.poses)[:, axes, 3].T
        curves.append(Curve(x, y, row.label, colour, width=1.8))
        curves += _edges(report, row, np.stack([x, y], axis=1))
    closed = any(loop.accepted for _, run in report.runs for loop in run.loops)
    x, y = reference.poses[:1, axes, 3].T
    curves.append(Curve(x, y, "start", TRUTH, width=0, symbol="square"))
    how = f"aligned to the {name} by SE(3) Umeyama" if report.truth else f"aligned to {name} by SE(3) Umeyama"
    return Chart(
        "trajectory",
        "Trajectories from above",
        f"Each trajectory {how if len(pairs) else 'not aligned'}. " + (_loops_caption(report) if closed else ""),
        f"Map of {len(report.rows)} trajectories: " + _extent(reference.poses[:, axes, 3]),
        f"{'xyz'[axes[0]]} [m]",
        [Panel(f"{'xyz'[axes[1]]} [m]", curves)],
        equal=True,
    )


def _loops_caption(report: Report) -> str:
    false = f"; crosses: loops more than {FALSE_BEYOND:g} m off the {report.truth_name}" if report.truth else ""
    return f"Dotted: the odometry before loop closure. Thin straight lines: accepted loop closures{false}."


def _edges(report: Report, row: Row, xy: Array) -> Iterator[Curve]:
    """Accepted loops of a run as lines between their two frames, and crosses at the false ones."""
    if row.run is None or not (found := closures(row.run, row.track, report.truth)):
        return
    position = {number: k for k, number in enumerate(row.run.frames.numbers.tolist())}
    ends = [(position[one.loop.i], position[one.loop.j]) for one in found]
    gap = np.full((1, 2), np.nan)
    x, y = np.concatenate([np.concatenate([xy[[i, j]], gap]) for i, j in ends]).T
    yield Curve(x, y, f"{row.label}, loops", report.colours[row.label], width=0.8)
    wrong = [position[one.loop.j] for one in found if one.false]
    if wrong:
        x, y = xy[wrong].T
        yield Curve(x, y, f"{row.label}, false loops", report.colours[row.label], width=0, symbol="x")


def _error(report: Report, rows: Sequence[Row], pairs: dict[str, Pairs]) -> Chart:
    name = report.reference[0]
    curves, worst = [], []
    for row in rows:
        pair, colour = pairs[row.label], report.colours[row.label]
        if row.run and any(loop.accepted for loop in row.run.loops) and (before := report.pairs(row.run.odometry)):
            curves.append(Curve(before.along, before.errors, f"{row.label}, odometry", colour, "dot", 1.2))
        curves.append(Curve(pair.along, pair.errors, row.label, colour))
        worst.append(f"{row.label} at most {pair.errors.max():.3f} m, at {pair.travelled[pair.errors.argmax()]:.0f} m")
    return Chart(
        "error",
        "Error along the path" if report.truth else f"Distance to {name} along the path",
        f"Distance of each position to the {name if report.truth else 'trajectory of ' + name} at the same instant, "
        "after SE(3) Umeyama alignment over the whole trajectory" + ("; its rmse is the ATE." if report.truth else "."),
        "; ".join(worst),
        pairs[rows[0].label].along_title,
        [Panel("position error [m]" if report.truth else "distance [m]", curves, from_zero=True)],
    )


def _segments(report: Report, rows: Sequence[Row], pairs: dict[str, Pairs]) -> Chart:
    translation, rotation, best = [], [], []
    for row in rows:
        means = drift_by_length(pairs[row.label].estimate, pairs[row.label].reference)
        if not means:
            continue
        length = np.array([each.length_m for each in means])
        percent = np.array([each.translation_percent for each in means])
        degrees = np.array([each.rotation_deg_per_100m for each in means])
        colour = report.colours[row.label]
        translation.append(Curve(length, percent, row.label, colour, symbol="circle"))
        rotation.append(Curve(length, degrees, row.label, colour, symbol="circle"))
        best.append(f"{row.label} {percent[-1]:.2f} % over {length[-1]:g} m")
    return Chart(
        "segments",
        "Drift by segment length" if report.truth else f"Difference to {report.reference[0]} by segment length",
        f"Mean {'error' if report.truth else 'difference'} of the relative pose over segments of each length, divided "
        "by the length; definition as KITTI's drift, no alignment.",
        "; ".join(best),
        "segment length [m]",
        [
            Panel("translation [%]", translation, from_zero=True),
            Panel("rotation [deg/100 m]", rotation, from_zero=True),
        ],
    )


def _height(report: Report, pairs: dict[str, Pairs]) -> Chart:
    """Heights with the first pose on that of the reference, so that drift grows along the path as it did."""
    name, reference = report.reference
    row_up, sign = (1, -1) if body_frame(reference.poses) == "camera" else (2, 1)

    def height(poses: Array) -> Array:
        return np.asarray(sign * poses[:, row_up, 3])

    curves, ends = [], []
    if report.truth:
        pair = next(iter(pairs.values()), None)
        if pair:
            curves.append(_band(pair.along, height(pair.reference), name))
    for row in report.rows:
        if row.label not in pairs:
            continue
        pair = pairs[row.label]
        z = height(_from_same_start(pair))
        curves.append(Curve(pair.along, z, row.label, report.colours[row.label]))
        ends.append(f"{row.label} ends {z[-1] - height(pair.reference)[-1]:+.3f} m from the reference")
    return Chart(
        "height",
        "Height profile",
        "Height along the path, with the first pose aligned to that of the "
        f"{name if report.truth else 'trajectory ' + name}. Height is what few channels lose first: the ground in "
        "front is seen by a few rings only.",
        "; ".join(ends),
        next(iter(pairs.values())).along_title,
        [Panel("height [m]", curves)],
    )


def _from_same_start(pair: Pairs) -> Array:
    return np.asarray(pair.reference[0] @ se3.inverse(pair.estimate[0]) @ pair.estimate)


def _band(x: Array, y: Array, name: str) -> Curve:
    """The ground truth: a broad band under the estimates."""
    return Curve(x, y, name, TRUTH, width=6)


def _extent(xy: Array) -> str:
    width, height = np.nanmax(xy, axis=0) - np.nanmin(xy, axis=0)
    return f"an area of {width:.0f} m by {height:.0f} m."
