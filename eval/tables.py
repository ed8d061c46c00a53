"""Tables of figures for the terminal, each with its protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING

from eval.compare import Comparison, RunFigures
from eval.kitti_metric import BodyRotationRemoved, Drift
from eval.metrics import Metrics
from eval.text import new_table, number, paragraphs, protocol_text, rendered, text_table
from eval.trajectory import STATISTICS

if TYPE_CHECKING:
    from rich.table import Table

#: Row title, attribute of `Metrics`, unit, decimals.
ERROR_ROWS = (
    ("ATE, SE(3) Umeyama-aligned", "ate.aligned", "m", 3),
    ("ATE, origin-aligned", "ate.origin", "m", 3),
    ("ATE, unaligned", "ate.unaligned", "m", 3),
    ("RPE translation, delta 1 frame", "rpe.frame", "m", 4),
    ("RPE rotation, delta 1 frame", "rpe.frame_rotation", "deg", 4),
    ("Paper's Table III: RPE translation, delta 1 frame, Umeyama", "paper_table_iii", "m", 4),
)

#: Column title, attribute of `RunFigures`, format.
COMPARISON_COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("ATE\n[m]", "ate_m", ".3f"),
    ("RPE\n[m]", "rpe_m", ".4f"),
    ("RPE\n[deg]", "rpe_deg", ".4f"),
    ("drift\n[%]", "drift_percent", ".3f"),
    ("drift\n[deg/100 m]", "drift_deg_per_100m", ".3f"),
    ("to full\n[m]", "to_full_m", ".3f"),
    ("path\n[m]", "path_m", ".1f"),
    ("frames", "frames", "d"),
    ("failed", "failed", "d"),
    ("loops", "loops", "d"),
    ("map\npoints", "map_points", ",d"),
    ("points\nper scan", "points_per_scan", ",d"),
    ("front end\n[ms]", "front_end_ms", ".1f"),
    ("odometry\n[ms]", "odometry_ms", ".1f"),
)


def format_metrics(evaluations: Mapping[str, Metrics]) -> str:
    """Format the errors and the drift of trajectories as plain text, without a limit of the width.

    Args:
        evaluations: The metrics by name ("slam", "16", a file); all have the same protocol.

    Returns:
        Two tables, the notes, and the protocol.
    """
    notes = [f"{name}: {note}" for name, metrics in evaluations.items() for note in metrics.notes]
    drifts = [(name, metrics.drift) for name, metrics in evaluations.items()]
    notes += [f"{name}: no drift, {drift.reason}" for name, drift in drifts if drift.reason]
    protocol = next(iter(evaluations.values())).protocol
    return _with_notes([rendered(_errors(evaluations)), rendered(_drift(evaluations))], notes, protocol)


def format_comparison(comparison: Comparison) -> str:
    """Format a table with one row per input, the paper's Table III if there is ground truth, notes and protocol."""
    tables = [text_table(header, rows) for header, rows in _compared(comparison)]
    return _with_notes(tables, _notes(comparison), comparison.protocol)


def comparison_markdown(comparison: Comparison, title: str) -> str:
    """Format the content of `format_comparison` in Markdown, for compare.md."""
    lines = [f"# {title}", ""]
    for header, rows in _compared(comparison):
        titles = [" ".join(column.split()) for column in header]
        lines += [_cells(titles), _cells(["---", *["---:"] * (len(titles) - 1)]), *map(_cells, rows), ""]
    lines += [f"* {note}" for note in _notes(comparison)]
    lines += [f"* {name}: {text}" for name, text in comparison.protocol.items()]
    return "\n".join(lines) + "\n"


def _compared(comparison: Comparison) -> list[tuple[list[str], list[list[str]]]]:
    """Header and rows of each table of a comparison."""
    inputs = comparison.inputs

    known = {key for figures in inputs.values() for key, value in vars(figures).items() if value is not None}
    columns = [column for column in COMPARISON_COLUMNS if column[1] in known or comparison.kind == "inputs"]

    def row(name: str, figures: RunFigures) -> list[str]:
        values = ((getattr(figures, key), form) for _, key, form in columns)
        return [name, *("-" if value is None else format(value, form) for value, form in values)]

    header = ["Input" if comparison.kind == "inputs" else "Trajectory", *(title for title, _, _ in columns)]
    tables = [(header, [row(*entry) for entry in inputs.items()])]
    if len(comparison.distances_m) > 1:
        tables.append(_distances(comparison.distances_m))
    measured = {name: figures.table_iii_m for name, figures in inputs.items() if figures.table_iii_m}
    if measured:
        names = ("max", "mean", "min", "rmse", "std")  # in the paper's order
        rows = [[name, *(number(getattr(figures, key), 3) for key in names)] for name, figures in measured.items()]
        tables.append((["Table III", *(f"{name} [m]" for name in names)], rows))
    return tables


def _distances(distances: Mapping[str, Mapping[str, float]]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the distances between every two trajectories."""
    rows = [[one, *(number(between.get(other), 3) for other in distances)] for one, between in distances.items()]
    return ["Distance, rmse [m]", *distances], rows


def _notes(comparison: Comparison) -> list[str]:
    own = [f"{name}: {note}" for name, figures in comparison.inputs.items() for note in figures.notes]
    return [*comparison.notes, *own]


def _cells(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |"


def _errors(evaluations: Mapping[str, Metrics]) -> Table:
    table = new_table("Error", "of", "frames", "unit", *STATISTICS[:-1], "sse [unit²]", left=2)
    for title, attribute, unit, decimals in ERROR_ROWS:
        for row, (name, metrics) in enumerate(evaluations.items()):
            values = attrgetter(attribute)(metrics)
            figures = (number(getattr(values, statistic), decimals) for statistic in STATISTICS)
            table.add_row("" if row else title, name, str(metrics.frames), unit, *figures)
        table.add_section()
    return table


def _drift(evaluations: Mapping[str, Metrics]) -> Table:
    units = "translation [%]", "rotation [deg/100 m]", "path [m]", "reference path [m]"
    table = new_table("Drift, KITTI metric, no alignment", "of", "segments", *units, left=2)
    for name, metrics in evaluations.items():
        drift = metrics.drift
        path = number(metrics.path_length_m, 1), number(metrics.reference_path_length_m, 1)
        table.add_row(drift.name, name, str(drift.segments), *_rates(drift), *path)
        if removed := drift.body_rotation_removed:
            title = f"  without the best body rotation, {number(removed.rotation_deg, 2)} deg"
            table.add_row(title, name, str(drift.segments), *_rates(removed))
    return table


def _rates(drift: Drift | BodyRotationRemoved) -> tuple[str, str]:
    return number(drift.translation_percent, 3), number(drift.rotation_deg_per_100m, 3)


def _with_notes(tables: Sequence[str], notes: Sequence[str], protocol: Mapping[str, str]) -> str:
    noted = ["Notes\n" + paragraphs(notes)] if notes else []
    return "\n".join([*tables, *noted, protocol_text(protocol)])
