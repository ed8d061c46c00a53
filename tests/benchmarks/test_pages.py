"""The committed pages are those that the scripts make of the committed figures."""

from __future__ import annotations

import importlib
import json
import re
import sys
from pathlib import Path

import pytest

from benchmarks.common.page import surroundings, write_results

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
RESULTS = BENCHMARKS / "results"
NAMES = sorted(path.stem for path in RESULTS.glob("*.md") if path.stem != "same_bytes")


@pytest.mark.parametrize("name", NAMES)
def test_pages_agree_with_their_figures(name: str, tmp_path: Path) -> None:
    (script,) = BENCHMARKS.glob(f"*/{name}.py")
    module = importlib.import_module(f"benchmarks.{script.parent.name}.{name}")
    found = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    write_results(tmp_path, name, found, module.page)
    made = (tmp_path / f"{name}.md").read_text(encoding="utf-8")
    assert made == (RESULTS / f"{name}.md").read_text(encoding="utf-8")
    assert json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8")) == found


@pytest.mark.parametrize("page", [BENCHMARKS / "README.md", *(RESULTS / f"{name}.md" for name in NAMES)])
def test_links_exist(page: Path) -> None:
    for link in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
        assert (page.parent / link).is_file(), link


def test_the_table_lists_every_page_and_its_command() -> None:
    table = (BENCHMARKS / "README.md").read_text(encoding="utf-8")
    for name in NAMES:
        (script,) = BENCHMARKS.glob(f"*/{name}.py")
        assert f"(results/{name}.md)" in table
        assert f"`{script.parent.name}.{name} " in table
    assert len(table.splitlines()) <= 120


def test_the_command_of_a_page_has_no_folders_of_the_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "town").mkdir()
    words = [
        f"{tmp_path}/town",
        f"{tmp_path}/town:full",
        f"--data={tmp_path}/town",
        "--frames",
        ":60",
        "--results",
        "x",
    ]
    monkeypatch.setattr(sys, "argv", ["script", *words])
    assert surroundings(())["command"].endswith(" town town:full --data=town --frames :60")
