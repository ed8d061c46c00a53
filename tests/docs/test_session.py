"""docs/session.md has the columns of all tables."""

from __future__ import annotations

import re
from pathlib import Path

from slam.journal.session_file import APPLICATION, FORMAT
from slam.journal.tables import TABLES

PAGE = (Path(__file__).parents[2] / "docs" / "session.md").read_text(encoding="utf-8")


def test_the_page_has_the_tables() -> None:
    rows = dict(re.findall(r"^\| `([a-z]+)` \| ([^|]*) \|", PAGE, re.MULTILINE))
    assert rows.pop("about") == "name, value (JSON)"
    assert rows == {name: ", ".join(column for column, _ in table.columns) for name, table in TABLES.items()}


def test_the_page_has_the_format() -> None:
    assert f"## Format {FORMAT}\n" in PAGE
    assert f"0x{APPLICATION:X}" in PAGE
