"""Tables and paragraphs as plain text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from math import isfinite
from textwrap import fill
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


def number(value: float | None, decimals: int, factor: float = 1) -> str:
    """`factor` times the value with fixed decimals, a dash for what could not be computed: None, or not finite.

    >>> number(0.1234, 1, factor=100), number(None, 1)
    ('12.3', '-')
    """
    return "-" if value is None or not isfinite(value) else f"{factor * value:.{decimals}f}"


def text_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Plain text, as wide as it needs to be; the first column is flushed left, the others right."""
    table = new_table(*titles, left=1)
    for row in rows:
        table.add_row(*row)
    return rendered(table)


def protocol_text(protocol: Mapping[str, str]) -> str:
    """What figures mean, a paragraph each."""
    return "Protocol\n" + paragraphs([f"{name}: {text}" for name, text in protocol.items()])


def new_table(*columns: str, left: int) -> Table:
    """Without lines but that under the header; the first `left` columns flush left, the others right."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index < left else "right", no_wrap=True)
    return table


def paragraphs(texts: Sequence[str]) -> str:
    """Each folded at 118 characters and indented."""
    return "".join(fill(text, 118, initial_indent="  ", subsequent_indent="    ") + "\n" for text in texts)


def rendered(table: Table) -> str:
    """As plain text without colour, as wide as it needs to be, never cut."""
    from rich.console import Console

    text = StringIO()
    Console(file=text, width=10_000, no_color=True, markup=False, emoji=False, highlight=False).print(table)
    return "".join(line.rstrip() + "\n" for line in text.getvalue().splitlines() if line.strip())
