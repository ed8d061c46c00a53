"""`lidarlift study`: the tables and pictures of both studies, and one line for what is wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

Drive = Callable[..., Path]
Command = Callable[..., Any]


@pytest.fixture
def filmed(street_drive: Drive) -> Path:
    """The street drive with images, the left half darker; number 3 is missing. Number 6 has exact depth, too."""
    sequence = street_drive()
    image = np.full((360, 500, 3), 90, np.uint8)
    image[:, 250:] = 190
    for folder in ("image_2", "depth_2"):
        (sequence / folder).mkdir()
    for frame in (0, 1, 2, 4, 5, 6, 7):
        cv2.imwrite(str(sequence / "image_2" / f"{frame:06d}.png"), image)
    cv2.imwrite(str(sequence / "depth_2" / "000006.png"), np.full((360, 500), 2560, np.uint16))
    return sequence


@pytest.mark.parametrize("study", ["sparsity", "edges"])
def test_a_study_writes_table_figures_and_plot(
    lidarlift: Command, filmed: Path, study: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames 0, 3 and 6 of 8 where no more than three are wanted."""
    monkeypatch.setattr("lidarlift.cli.study.FRAMES", 3)
    result = lidarlift("study", study, filmed, "--out", "s")
    assert result.code == 0, result.err
    assert "Note: left out: scan 3: no image" in result.err
    found = json.loads(Path("s/study.json").read_text())
    assert found["about"]["frames"] == [0, 6]
    assert list(found) == ["about", "returns, interpolated", "exact depth"]
    assert Path("s/study.png").read_bytes().startswith(b"\x89PNG")
    rows = [line.split() for line in result.out.splitlines()]
    if study == "sparsity":
        assert found["exact depth"]["largest"]["0.015625"]["rmse_m"] == pytest.approx(0, abs=1e-9)
        errors = [figures["rmse_m"] for figures in found["returns, interpolated"]["lowest"].values()]
        assert errors == sorted(errors)
        assert ["largest", "1/64"] in [row[:2] for row in rows]
    else:
        assert 0 < found["returns, interpolated"]["canny"]["90"]["edges"] < 0.02
        assert found["exact depth"]["canny"]["90"]["precision"] == 0
        assert found["exact depth"]["canny"]["90"]["recall"] is None
        assert ["canny", "90"] in [row[:2] for row in rows]


def test_help_has_examples(lidarlift: Command) -> None:
    for arguments in ((), ("sparsity",), ("edges",)):
        assert "Example" in lidarlift("study", *arguments, "--help").out


def test_errors_are_one_line(lidarlift: Command, filmed: Path) -> None:
    lidarlift("study", "edges", "nowhere").refused("nowhere")
    lidarlift("study", "edges", filmed, "--frames", "9:").refused("the sequence has 8")
    result = lidarlift("study", "edges", filmed, "--frames", "3:4")
    assert result.code == 1
    assert "no image" in result.err
    assert lidarlift("study", "walk", filmed).code == 2
    assert not Path("runs").exists()
