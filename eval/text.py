"""Formatting of tables and paragraphs as plain text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from math import isfinite
from textwrap import fill
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


def number(value: float | None, decimals: int, factor: float = 1) -> str:
    """Format `factor` times the value with fixed decimals, or a dash for None and non-finite values.

    Example:
        >>> number(0.1234, 1, factor=100), number(None, 1)
        ('12.3', '-')
    """
    return "-" if value is None or not isfinite(value) else f"{factor * value:.{decimals}f}"


def text_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table without a limit of the width, the first column flush left, the others flush right."""
    table = new_table(*titles, left=1)
    for row in rows:
        table.add_row(*row)
    return rendered(table)


def protocol_text(protocol: Mapping[str, str]) -> str:
    """Format the definitions of figures, one paragraph each."""
    return "Protocol\n" + paragraphs([f"{name}: {text}" for name, text in protocol.items()])


def new_table(*columns: str, left: int) -> Table:
    """Return an empty table with a line under the header; the first `left` columns flush left, the others right."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index < left else "right", no_wrap=True)
    return table


def paragraphs(texts: Sequence[str]) -> str:
    """Wrap texts at 118 characters, with indentation."""
    return "".join(fill(text, 118, initial_indent="  ", subsequent_indent="    ") + "\n" for text in texts)


def rendered(table: Table) -> str:
    """Render a table as plain text, without colour and without a limit of the width."""
    from rich.console import Console

    text = StringIO()
    Console(file=text, width=10_000, no_color=True, markup=False, emoji=False, highlight=False).print(table)
    return "".join(line.rstrip() + "\n" for line in text.getvalue().splitlines() if line.strip())
