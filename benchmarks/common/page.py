"""Results as JSON and as a page made from it: hardware and versions, tables, targets met and missed."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from operator import ge, le, lt
from pathlib import Path
from typing import Any

from eval.evaluation import write_json
from eval.text import number
from slam.data.atomic import write_text

RELATIONS: dict[str, Callable[[float, float], bool]] = {">=": ge, "<=": le, "<": lt, "≥": ge, "≤": le}


def write_results(folder: Path, name: str, found: Mapping[str, Any], page: Callable[[Mapping[str, Any]], str]) -> None:
    """Write results as NAME.json and the page made from them as NAME.md.

    Args:
        folder: where to write.
        name: of the two files; by convention the script's.
        found: the results, which `page` gets too.
        page: makes the Markdown text.

    Raises:
        InputError: where the folder cannot be written.
    """
    write_json(folder / f"{name}.json", found)
    write_text(folder / f"{name}.md", page(found).strip() + "\n")
    print(f"wrote {name}.json and {name}.md in {folder}")


def without_about(found: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of a results file that are drives or methods: all but "about"."""
    return {name: figures for name, figures in found.items() if name != "about"}


def surroundings(packages: Iterable[str]) -> dict[str, Any]:
    """Where, when and with what was measured: hardware, versions, date and command."""
    return {
        "command": _command(),
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30),
        "load_average": round(os.getloadavg()[0], 2),
        "date": date.today().isoformat(),
        "versions": {"python": platform.python_version()} | {name: _version(name) for name in packages},
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return version(f"{package}-cpu")  # Open3D has two names


def _command() -> str:
    """As it was typed, without this machine's folders and without --results."""
    spec = sys.modules["__main__"].__spec__
    words, typed = [f"python -m {spec.name}" if spec else Path(sys.argv[0]).name], iter(sys.argv[1:])
    for word in typed:
        if word == "--results":
            next(typed)
        elif not word.startswith("--results="):
            name, equals, value = word.rpartition("=")
            path, colon, rest = value.partition(":")  # as in FOLDER:INPUT
            words.append(name + equals + (Path(path).name if path and Path(path).exists() else path) + colon + rest)
    return " ".join(words)


def _cpu_model() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def table(header: Sequence[str], rows: Iterable[Sequence[str]], words: int = 1) -> str:
    """A Markdown table; the first `words` columns to the left, the numbers after them to the right."""
    rule = ["---" if column < words else "---:" for column in range(len(header))]
    return "\n".join("| " + " | ".join(row) + " |" for row in (header, rule, *rows)) + "\n"


def verdict(value: float | None, relation: str, limit: float | None) -> str:
    """Return 'met' or 'missed', or a dash without a value or a limit."""
    if value is None or limit is None:
        return "-"
    return "met" if RELATIONS[relation](value, limit) else "missed"


def target(name: str, value: float | None, relation: str, limit: float, digits: int) -> tuple[str, str, str, str]:
    """Return a row of a table: the target, the figure, the limit, and whether it is met."""
    return name, number(value, digits), f"{relation} {limit}", verdict(value, relation, limit)
