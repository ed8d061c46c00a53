"""Tables that are printed as HTML, Markdown and LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import isfinite

from eval.text import number

#: Rows of a table that the page shows without a scroll bar of its own.
LONG = 14
LATEX = {
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "\\": r"\textbackslash{}",
    "²": r"$^2$",
    "±": r"$\pm$",
}


@dataclass(frozen=True)
class Column:
    """A column.

    Attributes:
        title: Title.
        unit: Unit, or "".
        decimals: Decimals of its numbers.
        best: Which number is emphasised: the "least", the "most", or none ("").
        help: Definition of the figure, shown with the title.
    """

    title: str
    unit: str = ""
    decimals: int = 0
    best: str = ""
    help: str = ""

    @property
    def heading(self) -> str:
        """Title with unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


Cell = str | float | int | None


@dataclass(frozen=True)
class Table:
    """A table; the first column names the rows.

    Attributes:
        key: Name of its files and its anchor in the page.
        title: Title.
        note: What a reader has to know of the figures.
        columns: The columns.
        rows: Cells of each row: texts, numbers, None where there is no figure.
        colours: Colour of each row's name, '#RRGGBB', or "".
    """

    key: str
    title: str
    note: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    colours: Sequence[str] = ()


def html(table: Table) -> str:
    """Return the table for the page: sortable by its headings, scrolling in its own box on narrow screens."""
    best = _best(table)
    heads = "".join(
        f'<th scope="col" aria-sort="none"{_class(table, c)}><button type="button"{_help(column)}>{_title(column)}'
        "</button></th>"
        for c, column in enumerate(table.columns)
    )
    shape = "scroll tall" if len(table.rows) > LONG else "scroll"
    body = []
    for k, row in enumerate(table.rows):
        colour = table.colours[k] if table.colours else ""
        mark = f'<span class="swatch" style="background:{colour}"></span>' if colour else ""
        first = f'<th scope="row">{mark}{escape(_text(row[0], table.columns[0]))}</th>'
        cells = (_cell(row[c], table.columns[c], (k, c) in best) for c in range(1, len(row)))
        body.append(f"<tr>{first}{''.join(cells)}</tr>")
    return (
        f'<div class="{shape}" role="region" tabindex="0" aria-labelledby="{table.key}-title">'
        f'<table class="sortable" id="table-{table.key}">'
        f'<caption id="{table.key}-title">{escape(table.title)}</caption>'
        f"<thead><tr>{heads}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
        f'<p class="note">{escape(table.note)}</p>'
    )


def markdown(table: Table) -> str:
    """Return the table in Markdown, the best figures in bold."""
    best = _best(table)
    lines = [f"### {table.title}", "", _line([column.heading for column in table.columns])]
    lines.append(_line(["---", *["---:"] * (len(table.columns) - 1)]))
    for k, row in enumerate(table.rows):
        texts = [_text(cell, column).replace("|", "\\|") for cell, column in zip(row, table.columns, strict=True)]
        lines.append(_line([f"**{text}**" if (k, c) in best else text for c, text in enumerate(texts)]))
    return "\n".join([*lines, "", table.note, ""])


def latex(table: Table) -> str:
    """Return the table in LaTeX (package booktabs), the best figures in bold."""
    best = _best(table)
    heads = " & ".join(_escaped(column.heading) for column in table.columns)
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{_escaped(f'{table.title}. {table.note}')}}}"]
    lines += [rf"\begin{{tabular}}{{l{'r' * (len(table.columns) - 1)}}}", r"\toprule", rf"{heads} \\", r"\midrule"]
    for k, row in enumerate(table.rows):
        texts = [_escaped(_text(cell, column)) for cell, column in zip(row, table.columns, strict=True)]
        lines.append(
            " & ".join(rf"\textbf{{{text}}}" if (k, c) in best else text for c, text in enumerate(texts)) + r" \\"
        )
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def _best(table: Table) -> set[tuple[int, int]]:
    """Row and column of the emphasised figures: the best of their column, if there is another one."""
    found = set()
    for c, column in enumerate(table.columns):
        values = {
            k: float(cell)
            for k, row in enumerate(table.rows)
            if isinstance(cell := row[c], int | float) and isfinite(cell)
        }
        if column.best and len(values) > 1:
            target = min(values.values()) if column.best == "least" else max(values.values())
            shown = number(target, column.decimals)
            found |= {(k, c) for k, value in values.items() if number(value, column.decimals) == shown}
    return found


def _text(cell: Cell, column: Column) -> str:
    if isinstance(cell, str):
        return cell
    if isinstance(cell, int):
        return f"{cell:,}"
    return number(cell, column.decimals)


def _cell(cell: Cell, column: Column, best: bool) -> str:
    text = escape(_text(cell, column))
    if isinstance(cell, str):
        return f'<td class="text">{text}</td>'
    value = f' data-value="{float(cell):.9g}"' if cell is not None and isfinite(cell) else ""
    return f"<td{value}>{f'<strong>{text}</strong>' if best else text}</td>"


def _class(table: Table, c: int) -> str:
    """The class of a column of texts."""
    return ' class="text"' if all(isinstance(row[c], str) for row in table.rows) else ""


def _title(column: Column) -> str:
    unit = f' <span class="unit">[{escape(column.unit)}]</span>' if column.unit else ""
    return escape(column.title) + unit


def _help(column: Column) -> str:
    return f' title="{escape(column.help, quote=True)}"' if column.help else ""


def _line(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |"


def _escaped(text: str) -> str:
    return "".join(LATEX.get(sign, sign) for sign in text)
