"""The verdict of a report: what the runs show, in sentences with their figures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eval.compare import DENSE
from eval.report.content import Report
from eval.report.loops import closures
from eval.runs import Row
from eval.text import number
from eval.trajectory import path_length

SAME = 0.05  # relative difference of two errors that is not called a difference
SPARSE, ENRICHED = "16", "enriched"


def verdict(report: Report) -> list[str]:
    """Return the verdict; the first sentence answers the main question, the others qualify it."""
    rows = {row.label: row for row in report.rows}
    measured = [row for row in report.rows if row.metrics]
    if SPARSE in rows and ENRICHED in rows:
        first = _enrichment(rows) if measured else _without_truth(report, rows)
    elif len(report.rows) > 1:
        first = _ranking(measured) if measured else _spread(report)
    else:
        first = _single(report.rows[0])
    return [*first, *_loops(report), *_failures(report)]


def _enrichment(rows: dict[str, Row]) -> list[str]:
    sparse, enriched = _ate(rows[SPARSE]), _ate(rows[ENRICHED])
    sentence = f"Enrichment {_changed('the ATE of 16 channels', sparse, enriched)}"
    label = next((label for label in DENSE if label in rows), None)
    dense = None if label is None else _ate(rows[label])
    if label is not None and dense is not None:
        sentence += f"; {label.replace('full', 'all')} measured channels have {_length(dense)}"
        if dense < sparse * (1 - SAME) and enriched < sparse * (1 - SAME):
            closed = (sparse - enriched) / (sparse - dense)
            sentence += f": {100 * min(closed, 1):.0f} % of the gap is closed"
    sentences = [sentence + "."]
    drifts = {label: row.metrics.drift for label, row in rows.items() if row.metrics}
    found = {label: drifts[label].translation_percent for label in (SPARSE, ENRICHED, *DENSE) if label in drifts}
    if all(value is not None for value in found.values()):
        listed = ", ".join(f"{value:.3f} % ({label})" for label, value in found.items())
        sentences.append(f"Drift: {listed}; {drifts[SPARSE].name}.")
    return sentences


def _without_truth(report: Report, rows: dict[str, Row]) -> list[str]:
    """Without ground truth nothing says which input is better; how far they are apart can be measured."""
    pair = report.with_reference(rows[SPARSE]).pairs(rows[ENRICHED].track)
    if pair is None:
        return ["There is no ground truth, so it cannot be said which input is more accurate."]
    off = float(np.sqrt((pair.errors**2).mean()))
    lengths = path_length(rows[SPARSE].track.poses), path_length(rows[ENRICHED].track.poses)
    return [
        f"There is no ground truth, so it cannot be said which input is more accurate: over {lengths[0]:.0f} m the "
        f"trajectories of 16 channels and enriched scans are {_length(off)} apart (rmse after alignment)."
    ]


def _ranking(measured: list[Row]) -> list[str]:
    ordered = sorted(measured, key=_ate)
    best, others = ordered[0], ordered[1:]
    rest = ", ".join(f"{row.label} {_length(_ate(row))}" for row in others)
    return [f"{best.label} has the lowest ATE: {_length(_ate(best))}" + (f"; {rest}." if rest else ".")]


def _spread(report: Report) -> list[str]:
    """Without ground truth: how far the trajectories are from the first one."""
    first, *others = report.rows
    apart = []
    for row in others:
        if pair := report.with_reference(first).pairs(row.track):
            apart.append(f"{row.label} {_length(float(np.sqrt((pair.errors**2).mean())))}")
    if not apart:
        return ["There is no ground truth, and the trajectories have no common instants, so they cannot be compared."]
    listed = ", ".join(apart)
    return [
        f"There is no ground truth; distance of the trajectories to {first.label} (rmse after alignment): {listed}."
    ]


def _single(row: Row) -> list[str]:
    length = path_length(row.track.poses)
    frames = f"{len(row.track.poses)} frame{'s' if len(row.track.poses) != 1 else ''}"
    if row.metrics is None:
        return [f"{frames} over {length:.1f} m; there is no ground truth, so the accuracy is unknown."]
    ate = _ate(row)
    share = (
        f", {100 * ate / row.metrics.reference_path_length_m:.2f} % of the path"
        if row.metrics.reference_path_length_m > 1
        else ""
    )
    drift = row.metrics.drift
    drifted = "" if drift.translation_percent is None else f"; drift {drift.translation_percent:.3f} % ({drift.name})"
    return [f"{frames} over {length:.1f} m with an ATE of {_length(ate)}{share}{drifted}."]


def _loops(report: Report) -> Iterator[str]:
    for row, run in report.runs:
        found = closures(run, row.track, report.truth)
        if not found:
            continue
        false = sum(one.false for one in found)
        count = f"{len(found)} loop{'s' if len(found) > 1 else ''}"
        if row.metrics and run.odometry_metrics:
            changed = _changed("the ATE", run.odometry_metrics.ate.aligned.rmse, _ate(row))
            text = f"{row.label}: loop closure {changed}; {count}, {false or 'none'} of them false"
        else:
            before, after = (float(np.median([getattr(one, name) for one in found])) for name in ("before", "after"))
            text = f"{row.label}: {count}, met by the trajectory within {_length(after)}, by the odometry within "
            text += f"{_length(before)} (median)"
        yield text + "."


def _failures(report: Report) -> Iterator[str]:
    kinds = ("degenerate", "failed")
    bad = {
        row.label: [f"{n} {kind}" for kind in kinds if (n := run.frames.status.count(kind))] for row, run in report.runs
    }
    listed = [f"{label}: {' and '.join(found)}" for label, found in bad.items() if found]
    if listed:
        yield f"Frames that were not registered in all directions: {'; '.join(listed)}."
    elif bad:
        yield "No frame failed."


def _ate(row: Row) -> float:
    return row.metrics.ate.aligned.rmse if row.metrics else float("inf")


def _changed(what: str, before: float, after: float) -> str:
    """'lowers the ATE from 2.1 m to 1.4 m (33 % less)'."""
    if abs(after - before) <= SAME * before:
        return f"hardly changes {what}: {_length(before)} without, {_length(after)} with"
    verb, more = ("lowers", "less") if after < before else ("raises", "more")
    return f"{verb} {what} from {_length(before)} to {_length(after)} ({100 * abs(after / before - 1):.0f} % {more})"


def _length(metres: float) -> str:
    return f"{number(metres, 1, factor=100)} cm" if metres < 1 else f"{number(metres, 2)} m"
