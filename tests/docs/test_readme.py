"""README.md and docs/: their Python runs, their commands exist, and the table has the figures of the benchmarks."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest
import typer.main

from lidarlift.cli.app import app
from slam.data.cloud import Array

ROOT = Path(__file__).parents[2]
README, RESULTS = ROOT / "README.md", ROOT / "benchmarks" / "results"
PAGES = [README, *sorted((ROOT / "docs").glob("*.md")), ROOT / "examples" / "README.md"]


def python_of(page: Path) -> str:
    (code,) = re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
    return code


def test_the_readmes_python(
    street_drive: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(python_of(README).replace("my_scans", str(street_drive())).replace("vlp16", "hdl64"), {})
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].startswith("(8, 4, 4) ")
    assert float(printed[1]) < 0.1
    assert (tmp_path / "runs/mine/map.pcd").is_file()


def test_the_quickstarts_live_scans(
    street_scans: list[Array], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    scans = [(0.1 * number, scan) for number, scan in enumerate(street_scans)]
    exec(python_of(ROOT / "docs/quickstart.md").replace("vlp16", "hdl64"), {"scans": scans})
    assert len(capsys.readouterr().out.splitlines()) == len(street_scans)
    assert (tmp_path / "runs/live/run.json").is_file()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_options_exist(page: Path) -> None:
    lines = re.findall(r"^(?:    |\$ )(lidarlift .*)$|`(lidarlift [a-z][^`]*)`", page.read_text(), re.MULTILINE)
    group = typer.main.get_command(app)
    for line in (block or inline for block, inline in lines):
        words = shlex.split(line, comments=True)[1:]
        if ">" in words:
            words = words[: words.index(">")]
        command, names = group, []
        while words and words[0] in getattr(command, "commands", {}):
            names.append(words[0])
            command = command.commands[words.pop(0)]  # type: ignore[attr-defined]
        known = {option for parameter in command.params for option in parameter.opts} | {"--help"}
        unknown = {word for word in words if word.startswith("--")} - known
        assert not unknown, f"{page.name}: {line}"
        assert names or words[0] in known | {"COMMAND"}, f"{page.name}: {line}"


def figures(page: str, section: str, *first: str) -> dict[str, str]:
    """The row that begins with these cells, of the first table of a section of a page of results."""
    text = (RESULTS / page).read_text()
    table = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.partition(f"\n## {section}\n")[2].partition("\n## ")[0].splitlines()
        if line.startswith("|")
    ]
    (row,) = (row for row in table if tuple(row[: len(first)]) == first)
    return dict(zip(table[0], row, strict=True))


def test_the_table_is_that_of_the_benchmarks() -> None:
    table = [line for line in README.read_text().splitlines() if line.startswith("| ")][1:]
    _, sparse, speed, loops, lost = table

    drive = "KITTI raw 2011_09_26_drive_0013"
    ours, kiss = (figures("frame_rate.md", drive, "16", system) for system in ("ndt", "kiss-icp"))
    assert f"| {100 * float(ours['to dense m']):.1f} cm | KISS-ICP {100 * float(kiss['to dense m']):.1f} cm |" in sparse
    ours, kiss = (figures("frame_rate.md", drive, "64", system) for system in ("ndt", "kiss-icp"))
    assert f"| {ours['median ms']} ms | KISS-ICP {kiss['median ms']} ms |" in speed

    page = (RESULTS / "kiss_slam.md").read_text()
    after = dict(re.findall(r"^\| 05 \| 16 \| \d+ \| ([\w-]+)[ \d.]* \| [\d.]+ \| ([\d.]+) \|", page, re.MULTILINE))
    assert f"| {after['lidarlift']} m | KISS-SLAM {after['KISS-SLAM']} m |" in loops

    ours, gicp, kiss = (figures("scenes.md", "bridge", "full", system) for system in ("ndt", "gicp", "kiss-icp"))
    ate = [f"{float(row['ATE m']):.1f}" for row in (ours, gicp, kiss)]
    assert f"| {ate[0]} m | GICP {ate[1]} m, KISS-ICP {ate[2]} m |" in lost


def test_the_cases_that_are_counted() -> None:
    """Cases where our ATE is below KISS-ICP's, and where the best peer's is below ours."""
    page = (RESULTS / "scenes.md").read_text()
    ranks = re.findall(r"^\| ([\w-]+) \| ([\w-]+) \| ([\w-]+) \| [\d.]+ \| ([\d.]+) \|.* of 6 \|$", page, re.MULTILINE)
    nearer = sum(
        float(ours) < float(figures("scenes.md", drive, given, "kiss-icp")["ATE m"]) for drive, given, _, ours in ranks
    )
    lost = sum(nearest != "ndt" for *_, nearest, _ in ranks)
    text = README.read_text()
    assert f"| {nearer} of {len(ranks)} cases | {len(ranks) - nearer} |" in text
    assert f"than lidarlift in {lost} of the {len(ranks)} cases" in text
