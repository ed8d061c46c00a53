"""The reports that `lidarlift run` and `compare` write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import lidarlift as package
from eval.report.scan import read_scan

Command = Callable[..., Any]
Drive = Callable[..., Path]


@pytest.mark.report
def test_a_run_ends_with_a_report(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive(), "--input", "16", "--out", "r", "--frames", "0:4")
    assert result.code == 0, result.err
    assert "report.html" in result.out
    page = Path("r/report.html").read_text()
    assert "16 channels, 4 frames" in page
    assert "--input 16 --out r --frames 0:4" in page  # how to repeat it
    scan = read_scan(Path("r"))
    assert scan is not None
    assert scan.number == 2  # in the middle
    assert len(scan.cloud) == 16 * 600
    assert Path("r/figures/scan.svg").exists()


@pytest.mark.report
def test_a_comparison_ends_with_one_report(lidarlift: Command, street_drive: Drive) -> None:
    drive = street_drive()
    result = lidarlift("compare", drive, "--out", "c", "--frames", "0:3", "--enricher", "ray-segment")
    assert result.code == 0, result.err
    page = Path("c/report.html").read_text()
    assert "Enrichment" in page
    for label in ("16", "enriched", "64"):
        assert f'<input type="radio" name="map" value="{label}"' in page
        assert not Path("c", label, "report.html").exists()


def test_a_run_from_python_has_a_report(street_drive: Drive, tmp_path: Path) -> None:
    package.run(street_drive(), frames=slice(0, 2), out=tmp_path / "r")
    page = (tmp_path / "r" / "report.html").read_text()
    assert "lidarlift run" in page  # the command that does the same
