"""The page of all tested inputs, from the tables of cases in tests/inputs.

    python -m benchmarks.inputs.cases

Writes docs/inputs.md. A test fails if the page and the cases differ.
"""

from __future__ import annotations

import re
import runpy
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from benchmarks.common.page import table
from benchmarks.common.script import parser, run_script
from slam.data.atomic import write_text

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "inputs.md"
#: Title of each section, and the module in tests/inputs whose CASES it lists.
SECTIONS = {
    "Point files": "test_point_files.py",
    "Point times, rings, names and stamps": "test_times.py",
    "Ground truth": "test_truth.py",
    "Ground truth in runs, poses and pose graphs": "test_poses_and_graphs.py",
    "Images and calibration": "test_images.py",
    "Interrupted runs and output": "test_interrupted_runs.py",
}
INTRODUCTION = """# Tested inputs

Files that caused errors in other programs or in earlier versions of lidarlift, and similar ones. Each row is a test in
`tests/inputs`: *before* is the result of earlier versions, *now* the result that the test checks. A problem, and what
is reported, is a note in the summary and an entry in `run.json`; what is refused ends in an error of one line that
names the file, the fault and the remedy. Letters after a number mark similar cases, R before it a finding of a review,
K a further similar case. [Data sets and conventions](data.md) describes the formats.

This page is written by `python -m benchmarks.inputs.cases`.
"""


class Case(Protocol):
    """The columns of a row, which all cases have."""

    number: str
    title: str
    before: str
    now: str


def main() -> None:
    """Write the page."""
    parser(__doc__).parse_args()
    write_text(PAGE, page())
    print(f"wrote {PAGE}")


def page() -> str:
    """Return the page's Markdown text."""
    sections = {title: cases_of(ROOT / "tests" / "inputs" / name) for title, name in SECTIONS.items()}
    count = sum(map(len, sections.values()))
    parts = [INTRODUCTION, f"There are {count} cases.\n"]
    for title, cases in sections.items():
        parts.append(f"## {title}\n\n{_rows(cases)}")
    return "\n".join(parts)


def cases_of(path: Path) -> Sequence[Case]:
    """Return the CASES of a test module, in their order."""
    cases: Sequence[Case] = runpy.run_path(str(path))["CASES"]
    return cases


def _rows(cases: Sequence[Case]) -> str:
    cells = ([case.number, *map(_escaped, (case.title, case.before, case.now))] for case in cases)
    return table(("number", "input", "before", "now"), cells, words=4)


def _escaped(text: str) -> str:
    return re.sub(r"([_*|<])", r"\\\1", text)


if __name__ == "__main__":
    run_script(main)
