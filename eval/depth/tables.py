"""Tables of predicted depth for the terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from eval.depth.metrics import BANDS
from eval.depth.report import VIEWS, DepthReport
from eval.text import number, protocol_text, text_table

#: Table II of Yue et al., on their 154 frames, after training on 1730.
PAPER = {
    "l2l": {"rmse_mm": 22160, "mae_mm": 2165},
    "li2l": {"rmse_mm": 26162, "mae_mm": 2622},
    "f2l": {"rmse_mm": 8339, "mae_mm": 1153},
}

#: Column title, keys in a view's figures in depth.json, factor, decimals.
FIGURE_COLUMNS: tuple[tuple[str, tuple[str, ...], float, int], ...] = (
    ("MAE\n[mm]", ("mae_mm",), 1, 0),
    ("RMSE\n[mm]", ("rmse_mm",), 1, 0),
    ("iMAE\n[1/km]", ("imae",), 1, 2),
    ("iRMSE\n[1/km]", ("irmse",), 1, 2),
    ("median\n[mm]", ("median_mm",), 1, 0),
    ("> 0.3 m\n[%]", ("worse_0.3m",), 100, 1),
    ("> 1 m\n[%]", ("worse_1m",), 100, 1),
    ("coverage\n[%]", ("coverage",), 100, 1),
    ("AUSE\n[mm]", ("ause_mm",), 1, 0),
    ("in sigma\n[%]", ("calibration",), 100, 1),
    ("trusted\n[%]", ("trusted", "coverage"), 100, 1),
    ("MAE,\ntrusted", ("trusted", "mae_mm"), 1, 0),
    ("MAE, 80 %\ncoverage", ("at_80", "mae_mm"), 1, 0),
    ("RMSE, 80 %\ncoverage", ("at_80", "rmse_mm"), 1, 0),
)
#: Columns that do not depend on the view.
METHOD_COLUMNS = {"ms": ("ms per\nframe", ("ms",), 1, 1), "parameters": ("param-\neters", ("parameters",), 1, 0)}
BAND_COLUMNS = tuple(
    (f"{low}-{high} m\n{title}", ("bands", f"{low}-{high}", key), factor, decimals)
    for low, high in BANDS
    for title, key, factor, decimals in (("MAE [mm]", "mae_mm", 1, 0), ("> 1 m [%]", "worse_1m", 100, 1))
)


def format_report(report: DepthReport) -> str:
    """Format tables with one row per method, followed by the protocol."""
    methods = {name: method.as_dict() for name, method in report.methods.items()}
    tables = [table for view, title in VIEWS.items() for table in _tables(view, title, methods)]
    return "\n".join([*tables, protocol_text(report.about.protocol)])


def _tables(view: str, title: str, methods: Mapping[str, Any]) -> Iterator[str]:
    """Tables of one view, if any method has figures for it; columns without any values are left out."""
    shown = {
        name: entry[view] | {key: entry.get(key) for key in METHOD_COLUMNS}
        for name, entry in methods.items()
        if view in entry
    }
    for columns in ((*FIGURE_COLUMNS, *METHOD_COLUMNS.values()), BAND_COLUMNS):
        lines = shown | (_papers(shown) if view == "image" and columns is not BAND_COLUMNS else {})
        rows = [[name, *(_cell(figures, *column[1:]) for column in columns)] for name, figures in lines.items()]
        used = [k for k in range(len(columns)) if any(row[k + 1] != "-" for row in rows)]
        if used:
            yield text_table(
                [title, *(columns[k][0] for k in used)], ([row[0], *(row[k + 1] for k in used)] for row in rows)
            )


def _papers(shown: Collection[str]) -> dict[str, Mapping[str, Any]]:
    """The paper's figures of its networks, for those that have rows."""
    return {f"{name}, the paper's": figures for name, figures in PAPER.items() if name in shown}


def _cell(figures: Mapping[str, Any], keys: tuple[str, ...], factor: float, decimals: int) -> str:
    value: Any = figures
    for key in keys:
        value = value.get(key) if value else None
    return number(value, decimals, factor)
