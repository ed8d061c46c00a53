"""Packages that the pages of docs build, installed as they stand there, and the commands of these pages."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@dataclass(frozen=True)
class Page:
    """A page whose package is installed."""

    name: str

    def run(self, lidarlift: Callable[..., Any], places: dict[str, Path], *more: str) -> int:
        """Run the page's commands with other paths in the place of those of the page and `more` arguments.

        Returns how many there were; each ends with exit code 0.
        """
        (commands,) = blocks(self.name, "console")
        for line in commands.splitlines():
            dollar, command, *words = shlex.split(line)
            assert (dollar, command) == ("$", "lidarlift")
            result = lidarlift(*(places.get(word, word) for word in words), *more)
            assert result.code == 0, result.err
        return len(commands.splitlines())


@pytest.fixture
def page(installed: Callable[[str, str, dict[str, str]], Path]) -> Callable[[str], Page]:
    """`page("adding-a-method.md")` with its package installed."""

    def made(name: str) -> Page:
        (project,), (source,) = blocks(name, "toml"), [block for block in blocks(name, "python") if "import" in block]
        about = tomllib.loads(project)
        (module,) = about["tool"]["setuptools"]["py-modules"]
        groups = about["project"]["entry-points"].items()
        entries = "".join(
            f"[{group}]\n" + "".join(f"{name} = {of}\n" for name, of in all_of_it.items())
            for group, all_of_it in groups
        )
        installed(about["project"]["name"], entries, {f"{module}.py": source})
        return Page(name)

    return made


def blocks(page: str, language: str) -> list[str]:
    """The code blocks of a page in that language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", (DOCS / page).read_text(), re.MULTILINE | re.DOTALL)
