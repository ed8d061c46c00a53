"""docs/adding-a-method.md: the package works as it stands there, and so do the commands."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "adding-a-method.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)


@pytest.fixture
def site(installed: Callable[[str, str, dict[str, str]], Path]) -> Path:
    """The folder in which the page's package is installed."""
    (project,), (source,) = blocks("toml"), [block for block in blocks("python") if "import" in block]
    about = tomllib.loads(project)
    (module,) = about["tool"]["setuptools"]["py-modules"]
    groups = about["project"]["entry-points"].items()
    entries = "".join(
        f"[{group}]\n" + "".join(f"{name} = {of}\n" for name, of in all_of_it.items()) for group, all_of_it in groups
    )
    return installed(about["project"]["name"], entries, {f"{module}.py": source})


def test_the_package_and_the_commands_of_the_page(
    site: Path, street_drive: Callable[..., Path], tmp_path: Path
) -> None:
    drive, (commands,) = street_drive(), blocks("console")
    lines = [line.removeprefix("$ ") for line in commands.splitlines()]
    assert len(lines) == 3
    for line in lines:
        words = [str(drive) if word == "my_drive" else word for word in shlex.split(line)]
        done = subprocess.run(
            [sys.executable, "-m", *words, "--frames", "0:2"], check=False, capture_output=True, text=True,
            cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(site)},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert (
        json.loads((tmp_path / "runs/halfway/run.json").read_text())["protocol"]["config"]["front_end"]["enricher"]
        == "halfway"
    )
    assert sorted(path.name for path in (tmp_path / "enriched").iterdir()) == ["000000.pcd", "000001.pcd"]
    report = json.loads((tmp_path / "runs/depth/depth.json").read_text())
    assert report["halfway"]["full"]["coverage"] > 0.3
    assert report["ray-segment"]["full"]["median_mm"] < report["halfway"]["full"]["median_mm"] < 1000
