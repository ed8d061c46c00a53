"""The examples in docstrings are true; those of lidarlift need data and are tested in tests/lidarlift."""

from __future__ import annotations

import doctest
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for package in ("slam", "enrichment", "eval")
    for path in sorted((ROOT / package).rglob("*.py"))
    if ">>>" in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples_are_true(name: str) -> None:
    found = doctest.testmod(import_module(name), extraglobs={"np": np})
    assert found.attempted > 0
    assert found.failed == 0
