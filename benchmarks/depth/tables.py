"""The table of methods, which all pages about depth contain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.common.page import table, without_about
from eval.depth.tables import VIEWS
from eval.text import number

HEADER = (
    "method", "MAE mm", "RMSE mm", "median mm", "> 0.3 m %", "> 1 m %", "coverage %", "AUSE mm", "in sigma %",
    "MAE 80 %", "RMSE 80 %", "> 1 m 80 %", "ms",
)  # fmt: skip


def of_views(report: Mapping[str, Any]) -> str:
    """A table for each view that depth.json of a sequence has: the camera's field of view, and all azimuths."""
    tables = ((title, _rows(report, view)) for view, title in VIEWS.items())
    return "\n".join(f"{title}:\n\n{table(HEADER, rows)}" for title, rows in tables if rows)


def _rows(report: Mapping[str, Any], view: str) -> list[Sequence[str]]:
    return [
        (
            name, *(number(figures[key], 0) for key in ("mae_mm", "rmse_mm", "median_mm")),
            *(number(figures[key], 1, 100) for key in ("worse_0.3m", "worse_1m", "coverage")),
            number(figures["ause_mm"], 0), number(figures["calibration"], 1, 100),
            *(number(figures["at_80"][key], 0) for key in ("mae_mm", "rmse_mm")),
            number(figures["at_80"]["worse_1m"], 2, 100), number(entry["ms"], 1),
        )
        for name, entry in without_about(report).items()
        if (figures := entry.get(view))
    ]  # fmt: skip
