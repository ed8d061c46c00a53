"""Figures as text for the terminal, each with its protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import StringIO
from textwrap import fill
from typing import TYPE_CHECKING, Any

from eval.evaluation import Metrics
from eval.trajectory import STATISTICS

if TYPE_CHECKING:
    from rich.table import Table

#: Row title, keys in the metrics, unit, decimals.
ROWS: tuple[tuple[str, tuple[str, ...], str, int], ...] = (
    ("ATE, SE(3) Umeyama-aligned", ("ate", "aligned"), "m", 3),
    ("ATE, origin-aligned", ("ate", "origin"), "m", 3),
    ("ATE, unaligned", ("ate", "unaligned"), "m", 3),
    ("RPE translation, delta 1 frame", ("rpe", "frame"), "m", 4),
    ("RPE rotation, delta 1 frame", ("rpe", "frame_rotation"), "deg", 4),
    ("Paper's Table III: RPE translation, delta 1 frame, Umeyama", ("paper_table_iii",), "m", 4),
)

#: Column title, key in an input's figures of a comparison, format.
COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("ATE\n[m]", "ate_m", ".3f"),
    ("RPE\n[m]", "rpe_m", ".4f"),
    ("RPE\n[deg]", "rpe_deg", ".4f"),
    ("drift\n[%]", "drift_percent", ".3f"),
    ("drift\n[deg/100 m]", "drift_deg_per_100m", ".3f"),
    ("path\n[m]", "path_m", ".1f"),
    ("frames", "frames", "d"),
    ("failed", "failed", "d"),
    ("loops", "loops", "d"),
    ("map\npoints", "map_points", ",d"),
    ("points\na scan", "points_per_scan", ",d"),
    ("front end\n[ms]", "front_end_ms", ".1f"),
    ("odometry\n[ms]", "odometry_ms", ".1f"),
)


def format_table(evaluations: Mapping[str, Metrics], protocol: Mapping[str, str] | None = None) -> str:
    """Two tables and their notes as plain text without colour; tables are as wide as they need to be, never cut.

    `evaluations` maps a name ("slam", "16", a file) to what `evaluate` returned; `protocol` is what `evaluate_files`
    or `evaluate_run` put beside it and is printed line by line below.
    """
    notes = [f"{name}: {note}" for name, metrics in evaluations.items() for note in metrics.get("notes", ())]
    drifts = [(name, metrics["drift"]) for name, metrics in evaluations.items()]
    notes += [f"{name}: no drift, {drift['reason']}" for name, drift in drifts if drift["reason"]]
    return _with_notes([_errors(evaluations), _drift(evaluations)], notes, protocol or {})


def format_comparison(comparison: Mapping[str, Any]) -> str:
    """What `compare_runs` returned as a table with a row an input, its notes and its protocol, as `format_table`."""
    inputs = comparison["inputs"]
    table = _table("Input", *(title for title, _, _ in COLUMNS), left=1)
    for name, figures in inputs.items():
        values = ((figures[key], form) for _, key, form in COLUMNS)
        table.add_row(name, *("-" if value is None else format(value, form) for value, form in values))
    notes = [f"{name}: {note}" for name, figures in inputs.items() for note in figures["notes"]]
    return _with_notes([table], notes, comparison["protocol"])


def number(value: float | None, decimals: int) -> str:
    """Fixed decimals, a dash for what could not be computed."""
    return "-" if value is None else f"{value:.{decimals}f}"


def _errors(evaluations: Mapping[str, Metrics]) -> Table:
    table = _table("Error", "of", "frames", "unit", *STATISTICS[:-1], "sse [unit²]", left=2)
    for title, keys, unit, decimals in ROWS:
        for row, (name, metrics) in enumerate(evaluations.items()):
            values: Any = metrics
            for key in keys:
                values = values[key]
            figures = (number(values[statistic], decimals) for statistic in STATISTICS)
            table.add_row("" if row else title, name, str(metrics["frames"]), unit, *figures)
        table.add_section()
    return table


def _drift(evaluations: Mapping[str, Metrics]) -> Table:
    units = "translation [%]", "rotation [deg/100 m]", "path [m]", "reference's path [m]"
    table = _table("Drift, KITTI metric, no alignment", "of", "segments", *units, left=2)
    for name, metrics in evaluations.items():
        drift = metrics["drift"]
        path = number(metrics["path_length_m"], 1), number(metrics["reference_path_length_m"], 1)
        table.add_row(drift["name"], name, str(drift["segments"]), *_rates(drift), *path)
        if removed := drift["body_rotation_removed"]:
            title = f"  less the best body rotation, {number(removed['rotation_deg'], 2)} deg"
            table.add_row(title, name, str(drift["segments"]), *_rates(removed))
    return table


def _rates(drift: Mapping[str, Any]) -> tuple[str, str]:
    return number(drift["translation_percent"], 3), number(drift["rotation_deg_per_100m"], 3)


def _table(*columns: str, left: int) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index < left else "right", no_wrap=True)
    return table


def _with_notes(tables: Sequence[Table], notes: Sequence[str], protocol: Mapping[str, str]) -> str:
    parts = [_render(table) for table in tables]
    if notes:
        parts.append("Notes\n" + _paragraphs(notes))
    if protocol:
        parts.append("Protocol\n" + _paragraphs([f"{name}: {text}" for name, text in protocol.items()]))
    return "\n".join(parts)


def _paragraphs(texts: Sequence[str]) -> str:
    return "".join(fill(text, 118, initial_indent="  ", subsequent_indent="    ") + "\n" for text in texts)


def _render(table: Table) -> str:
    from rich.console import Console

    text = StringIO()
    Console(file=text, width=10_000, no_color=True, markup=False, emoji=False, highlight=False).print(table)
    return "".join(line.rstrip() + "\n" for line in text.getvalue().splitlines() if line.strip())
