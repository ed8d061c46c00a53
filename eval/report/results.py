"""The tables of a report: accuracy, the paper's Table III, maps and loops, time and memory, the ledger of loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from eval.loops import FALSE_BEYOND
from eval.metrics import Metrics
from eval.report.content import Report
from eval.report.loops import closures
from eval.report.maps import NEIGHBOURS, RADIUS, MapFigures
from eval.report.table import Cell, Column, Table

ACCURACY = (
    Column("Input"),
    Column("Poses"),
    Column("Drift", "%", 3, "least", "KITTI's translation error over segments, no alignment"),
    Column("Drift", "deg/100 m", 3, "least", "KITTI's rotation error over segments, no alignment"),
    Column("ATE", "m", 3, "least", "Absolute trajectory error, rmse after SE(3) Umeyama alignment without scale"),
    Column("ATE, origin", "m", 3, "least", "The same with the first pose aligned to that of the ground truth"),
    Column("ATE, unaligned", "m", 3, "least", "The same without alignment"),
    Column("RPE", "m", 4, "least", "Relative pose error over consecutive frames, translation, rmse"),
    Column("RPE", "deg", 4, "least", "Relative pose error over consecutive frames, rotation, rmse"),
)
LOOP_ERRORS = (
    Column("Loop error before", "m", 3, help="Median distance between accepted loops and the odometry"),
    Column("after", "m", 3, help="The same with the trajectory after loop closure"),
)
#: Rows of the ledger that the page shows, and the tables' files hold, of each run; loops.csv has all.
LEDGER = 200


def accuracy(report: Report) -> Table | None:
    """Return the table of errors against the ground truth: odometry and SLAM of each row; None without ground truth."""
    rows: list[list[Cell]] = []
    colours = []
    for row in report.rows:
        if row.metrics is None:
            continue
        colour = report.colours[row.label]
        if row.run and row.run.odometry_metrics:
            closed = any(loop.accepted for loop in row.run.loops)
            poses = "odometry" if closed else "odometry = SLAM"
            rows.append([row.label, poses, *_errors(row.run.odometry_metrics)])
            colours.append(colour)
            if not closed:
                continue
        rows.append([row.label, "SLAM" if row.run else "trajectory", *_errors(row.metrics)])
        colours.append(colour)
    if not rows:
        return None
    drifts = sorted({row.metrics.drift.name for row in report.rows if row.metrics})
    note = (
        f"Lower is better; the best of each column is bold. Drift: {', '.join(drifts)}. All errors are rmse, but "
        "the drift is a mean. The definition of each figure is in the protocol below."
    )
    return Table("accuracy", f"Accuracy against {report.truth_name}", note, ACCURACY, rows, colours)


def paper_table(report: Report) -> Table | None:
    """Return the error of the paper's Table III for each row; None without ground truth."""
    names = ("max", "mean", "min", "rmse", "std")  # in the paper's order
    measured = [(row.label, row.metrics.paper_table_iii) for row in report.rows if row.metrics]
    if not measured:
        return None
    rows = [[label, *(getattr(found, name) for name in names)] for label, found in measured]
    columns = [Column("Input"), *(Column(name, "m", 4, "least") for name in names)]
    note = (
        "RPE of the translation over consecutive frames after SE(3) Umeyama alignment. The paper's own figures, over "
        "30 pairs: 16 channels 0.784, 0.247, 0.025, 0.295, 0.161; proposed 1.200, 0.250, 0.024, 0.371, 0.274 m."
    )
    return Table("table-iii", "Table III as the paper defines it", note, columns, rows, _colours(report, measured))


def distance_table(report: Report) -> Table | None:
    """Return how far the trajectories are from each other; None for one row."""
    if len(report.rows) < 2:
        return None
    columns = [Column("Input"), *(Column(f"to {row.label}", "m", 3) for row in report.rows)]
    rows: list[list[Cell]] = []
    for row in report.rows:
        cells: list[Cell] = [row.label]
        for other in report.rows:
            pair = None if other is row else report.with_reference(other).pairs(row.track)
            cells.append(float(np.sqrt((pair.errors**2).mean())) if pair else None)
        rows.append(cells)
    note = "Rmse of the positions between two trajectories at common instants, after SE(3) Umeyama alignment."
    return Table("distances", "Distance between trajectories", note, columns, rows, list(report.colours.values()))


def map_table(report: Report, figures: Mapping[str, MapFigures]) -> Table | None:
    """Return loops and maps of the runs; None if no row is a run."""
    if not report.runs:
        return None
    truth = report.truth is not None
    closed = any(loop.accepted for _, run in report.runs for loop in run.loops)
    columns = [
        Column("Input"),
        Column("Keyframes"),
        Column("Loops accepted"),
        Column("rejected"),
        *(
            [Column("false", help=f"Accepted, but more than {FALSE_BEYOND:g} m off the {report.truth_name}")]
            if truth
            else []
        ),
        *(LOOP_ERRORS if closed else ()),
        Column("Map points"),
        Column(
            "Density", "1/m²", 1, help="Map points per square metre of the squares of 1 m that have any, from above"
        ),
        Column("Entropy", "nats", 2, help=f"Mean map entropy, neighbours within {RADIUS} m"),
        Column("Plane thickness", "cm", 2, help="Median rms distance of the neighbours from their plane"),
    ]
    rows = []
    for row, run in report.runs:
        found = closures(run, row.track, report.truth)
        of = figures.get(row.label)
        sharp = of.sharpness if of else None
        false = [sum(one.false for one in found)] if truth else []
        cells: list[Cell] = [row.label, run.report["loops"].get("keyframes"), len(found), len(run.loops) - len(found)]
        cells += [*false, *([_median([one.before for one in found]), _median([one.after for one in found])] * closed)]
        cells += [run.report["map_points"], of.density if of else None]
        cells += [sharp.entropy if sharp else None, 100 * sharp.thickness_m if sharp else None]
        rows.append(cells)
    note = (
        f"Sharpness of the map: mean map entropy and plane thickness over neighbourhoods of {RADIUS} m with at least "
        f"{NEIGHBOURS} points (Droeschel and Behnke, ICRA 2018; Razlaw et al., ECMR 2015; thickness after their mean "
        "plane variance). Lower is sharper, but only maps of similar density can be compared: a denser map also shows "
        "finer and rougher surfaces."
    )
    return Table("map", "Loops and maps", note, columns, rows, _colours(report, report.runs))


def time_table(report: Report) -> Table | None:
    """Return frames, run times and memory of the runs; None if no row is a run."""
    if not report.runs:
        return None
    columns = [
        *(Column("Input"), Column("Frames"), Column("retried"), Column("degenerate"), Column("failed")),
        Column("Points per scan", help="Median number of points that the front end passes to the odometry"),
        Column("Front end", "ms", 1, "least", "Median per frame: from the scan as read to these points"),
        Column("Odometry", "ms", 1, "least", "Median per frame: from these points to the pose"),
        Column("95 %", "ms", 1, "least", "95th percentile of the odometry"),
        Column("Peak memory", "MB", help="Of the process, including earlier runs of a comparison"),
    ]
    rows = []
    for row, run in report.runs:
        counts, times = run.report["counts"], run.report["timings_ms"]
        cells: list[Cell] = [row.label, *(counts.get(name) for name in ("frames", "retried", "degenerate", "failed"))]
        cells += [round(float(np.median(run.frames.points)))]
        cells += [
            _time(times, "front_end", "median"),
            _time(times, "odometry", "median"),
            _time(times, "odometry", "p95"),
        ]
        rows.append([*cells, _whole(run.report.get("peak_memory_mb"))])
    note = (
        "On the machine of the run. In a comparison the runs follow each other in one process, whose peak memory can "
        "only grow."
    )
    return Table("time", "Frames, time and memory", note, columns, rows, _colours(report, report.runs))


def ledger(report: Report) -> Table | None:
    """Return the loop candidates of all runs, accepted ones first; None without any."""
    columns = [
        *(Column("Input"), Column("Frame"), Column("closes with"), Column("Status"), Column("Reason")),
        Column("Descriptor distance", "", 3),
        *(Column("Inliers", "", 2), Column("Overlap", "", 2)),
        Column("Odometry off", "m", 3, help="Distance between the loop and the odometry"),
        Column("SLAM off", "m", 3, help="Distance between the loop and the trajectory after loop closure"),
        Column("Truth off", "m", 3, help="Distance between the loop and the ground truth"),
    ]
    rows: list[list[Cell]] = []
    colours = []
    total = 0
    for row, run in report.runs:
        found = {id(one.loop): one for one in closures(run, row.track, report.truth)}
        total += len(run.loops)
        for loop in sorted(run.loops, key=lambda loop: not loop.accepted)[:LEDGER]:
            one = found.get(id(loop))
            off: list[Cell] = [one.before, one.after, one.off] if one else [None] * 3
            status = "accepted, false" if one and one.false else "accepted" if one else "rejected"
            evidence = [loop.distance, loop.inlier_ratio, loop.overlap]
            rows.append([row.label, str(loop.j), str(loop.i), status, loop.reason, *evidence, *off])
            colours.append(report.colours[row.label])
    if not rows:
        return None
    cut = "" if len(rows) == total else f" The first {LEDGER} of each run; loops.csv in its folder has all {total}."
    note = f"Every pair of keyframes that was registered as a possible loop, and what became of it.{cut}"
    return Table("ledger", "Loop candidates", note, columns, rows, colours)


def _errors(metrics: Metrics) -> list[Cell]:
    drift, ate, rpe = metrics.drift, metrics.ate, metrics.rpe
    return [
        *(drift.translation_percent, drift.rotation_deg_per_100m),
        *(ate.aligned.rmse, ate.origin.rmse, ate.unaligned.rmse, rpe.frame.rmse, rpe.frame_rotation.rmse),
    ]


def _time(times: Mapping[str, Any], stage: str, which: str) -> float | None:
    return times[stage][which] if stage in times else None


def _whole(value: float | None) -> int | None:
    return None if value is None else round(value)


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None


def _colours(report: Report, rows: Any) -> list[str]:
    """Colours of (label or row, ...) tuples."""
    return [report.colours[label if isinstance(label, str) else label.label] for label, _ in rows]
