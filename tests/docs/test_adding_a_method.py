"""docs/adding-a-method.md: the package works as it stands there, and so do the commands."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


def test_the_package_and_the_commands_of_the_page(
    page: Callable[[str], Any], lidarlift: Callable[..., Any], street_drive: Callable[..., Path], tmp_path: Path
) -> None:
    assert page("adding-a-method.md").run(lidarlift, {"my_sequence": street_drive()}, "--frames", "0:2") == 3
    settings = json.loads((tmp_path / "runs/halfway/run.json").read_text())["protocol"]["config"]
    assert settings["front_end"]["enricher"] == "halfway"
    assert sorted(path.name for path in (tmp_path / "enriched").iterdir()) == ["000000.pcd", "000001.pcd"]
    report = json.loads((tmp_path / "runs/depth/depth.json").read_text())
    assert report["halfway"]["full"]["coverage"] > 0.3
    assert report["ray-segment"]["full"]["median_mm"] < report["halfway"]["full"]["median_mm"] < 1000
