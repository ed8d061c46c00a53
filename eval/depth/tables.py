"""Figures of predicted depth as text for the terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from eval.depth.metrics import BANDS
from eval.text import new_table, number, paragraphs, rendered

VIEWS = {"image": "In the image", "full": "All around"}

#: Table II of Yue et al., on 154 frames of its own, after training on 1730.
PAPER = {
    "l2l": {"rmse_mm": 22160, "mae_mm": 2165},
    "li2l": {"rmse_mm": 26162, "mae_mm": 2622},
    "f2l": {"rmse_mm": 8339, "mae_mm": 1153},
}

#: Column title, keys in a view's figures, factor, decimals.
COLUMNS: tuple[tuple[str, tuple[str, ...], float, int], ...] = (
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
    ("MAE, best\n80 %", ("at_80", "mae_mm"), 1, 0),
    ("RMSE, best\n80 %", ("at_80", "rmse_mm"), 1, 0),
)
#: Of a method whatever the view.
OF_A_METHOD = {"ms": ("ms a\nframe", ("ms",), 1, 1), "parameters": ("param-\neters", ("parameters",), 1, 0)}
BAND_COLUMNS = tuple(
    (f"{low}-{high} m\n{title}", ("bands", f"{low}-{high}", key), factor, decimals)
    for low, high in BANDS
    for title, key, factor, decimals in (("MAE [mm]", "mae_mm", 1, 0), ("> 1 m [%]", "worse_1m", 100, 1))
)


def format_depth(report: Mapping[str, Any]) -> str:
    """What depth.json holds as tables with a row a method, as wide as they need to be, and the protocol below."""
    methods = {name: entry for name, entry in report.items() if name != "about"}
    tables = [table for view, title in VIEWS.items() for table in _tables(view, title, methods)]
    return "\n".join([*tables, text_protocol(report["about"]["protocol"])])


def text_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Plain text, as wide as it needs to be; the first column is flushed left, the others right."""
    table = new_table(*titles, left=1)
    for row in rows:
        table.add_row(*row)
    return rendered(table)


def text_number(value: float | None, factor: float, decimals: int) -> str:
    """So many times the value, a dash for what could not be computed."""
    return number(None if value is None else factor * value, decimals)


def text_protocol(protocol: Mapping[str, str]) -> str:
    """What figures mean, a paragraph each."""
    return "Protocol\n" + paragraphs([f"{name}: {text}" for name, text in protocol.items()])


def _tables(view: str, title: str, methods: Mapping[str, Any]) -> Iterator[str]:
    """Of one view, if any method has figures of it; columns that none has anything in are left out."""
    shown = {
        name: entry[view] | {key: entry.get(key) for key in OF_A_METHOD}
        for name, entry in methods.items()
        if view in entry
    }
    for columns in ((*COLUMNS, *OF_A_METHOD.values()), BAND_COLUMNS):
        lines = shown | (_papers(shown) if view == "image" and columns is not BAND_COLUMNS else {})
        rows = [[name, *(_cell(figures, *column[1:]) for column in columns)] for name, figures in lines.items()]
        used = [k for k in range(len(columns)) if any(row[k + 1] != "-" for row in rows)]
        if used:
            yield text_table(
                [title, *(columns[k][0] for k in used)], ([row[0], *(row[k + 1] for k in used)] for row in rows)
            )


def _papers(shown: Collection[str]) -> dict[str, Mapping[str, Any]]:
    """What the paper says of its networks, where these have rows."""
    return {f"{name}, the paper's": figures for name, figures in PAPER.items() if name in shown}


def _cell(figures: Mapping[str, Any], keys: tuple[str, ...], factor: float, decimals: int) -> str:
    value: Any = figures
    for key in keys:
        value = value.get(key) if value else None
    return text_number(value, factor, decimals)
