"""RESULTS.md and the JSON files beside it: each benchmark writes its own section."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from datetime import date
from importlib.metadata import version
from pathlib import Path

TITLE = "# Results\n\nWritten by the scripts of this folder; each replaces its own section.\n"


def surroundings(packages: Iterable[str]) -> dict[str, object]:
    """Where and with what was measured: hardware, versions, date."""
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30),
        "load_average": round(os.getloadavg()[0], 2),
        "date": date.today().isoformat(),
        "versions": {"python": platform.python_version()} | {name: version(name) for name in packages},
    }


def _cpu_model() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def number(value: float | None, digits: int) -> str:
    """With that many decimals; a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}f}"


def table(header: Sequence[str], rows: Iterable[Sequence[str]], words: int = 1) -> str:
    """A Markdown table; the first `words` columns to the left, the numbers after them to the right."""
    rule = ["---" if column < words else "---:" for column in range(len(header))]
    return "\n".join("| " + " | ".join(row) + " |" for row in (header, rule, *rows)) + "\n"


def target(name: str, value: float | None, relation: str, limit: float, digits: int) -> tuple[str, str, str, str]:
    """What was aimed at, the figure, the limit (`relation` is >= or <=), and whether it is met: a row of a table."""
    met = value is not None and (value >= limit if relation == ">=" else value <= limit)
    return name, number(value, digits), f"{relation} {limit}", "-" if value is None else "met" if met else "missed"


def write_section(file: Path, name: str, text: str) -> None:
    """Put `text` between the markers `<!-- name -->` and `<!-- /name -->`; the rest of the file stays as it is."""
    opening, closing = f"<!-- {name} -->", f"<!-- /{name} -->"
    content = file.read_text(encoding="utf-8") if file.is_file() else TITLE
    before, found, rest = content.partition(opening)
    after = rest.partition(closing)[2] if found else "\n"
    if not found:
        before = before.rstrip("\n") + "\n\n"
    beside = file.with_name(f".{file.name}.{os.getpid()}")
    beside.write_text(f"{before}{opening}\n{text.strip()}\n{closing}{after}", encoding="utf-8")
    beside.replace(file)
