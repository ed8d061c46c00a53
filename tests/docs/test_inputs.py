"""The page of tested inputs."""

from __future__ import annotations

import re

from benchmarks.inputs.cases import PAGE, page


def test_the_page_lists_the_cases_of_the_tests() -> None:
    """If this fails, run `python -m benchmarks.inputs.cases`."""
    assert PAGE.read_text(encoding="utf-8") == page()


def test_every_row_has_four_cells() -> None:
    rows = [line for line in page().splitlines() if line.startswith("| ")]
    assert len(rows) > 200
    assert {len(re.split(r"(?<!\\)\|", row)) for row in rows} == {6}
